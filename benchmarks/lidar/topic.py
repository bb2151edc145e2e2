"""What a scan from elsewhere costs: `lidar.driver = "topic"` beside the built-in driver, by turns.

Run: python -m benchmarks.lidar.topic [--rounds N] [--seconds S]. Needs an otherwise idle computer.

40 Hz of 1081 beams, by a Hokuyo over TCP and by sensor_msgs/LaserScan over a zenoh session of the benchmark's process.
A sample ends with the motor command's first byte. It begins, as in `wallride bench`, when the kernel has the last byte
for the car ("kernel": the session goes through a forwarder that notes the time), or where `put` has returned ("put":
what the publisher's own session takes is part of it).
"""

import argparse
import contextlib
import json
import math
import socket
import statistics
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import zenoh

from wallride.drivers.api import Scan
from wallride.runtime.ros.graph import scan_source
from wallride.runtime.ros.messages import ros_laser_scan
from wallride.runtime.wire.ports import is_taken
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph, attachment
from wallride.runtime.wire.zenoh_config import client_config
from wallride.sim.bench.answers import pair
from wallride.sim.bench.course import BenchScans, Picture, make_course
from wallride.sim.bench.devices import LidarPort
from wallride.sim.bench.rig import BenchError, Rig

RATE_HZ: Final = 40.0
WARM_UP_SCANS: Final = 200
"""More than the half second in which the driver only compares stamps."""
SCAN_B: Final = 3000
"""A chunk from this size on is a scan; the session's own messages are shorter."""
READ_B: Final = 1 << 16
KEY: Final = RosGraph(0, Distro.JAZZY, "lidar").data_key(scan_source("lidar/scan"))
BEAMS_A_TURN: Final = 1440
STEP_RAD: Final = 2 * math.pi / BEAMS_A_TURN


class Forwarder:
    """Forwards one TCP connection. given_s: when the kernel had each scan."""

    def __init__(self, port: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._port, self.given_s = port, list[float]()
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._connect, daemon=True).start()

    def _connect(self) -> None:
        with self._listener:  # a session that comes back is refused, and can end
            publisher, _ = self._listener.accept()
        car = socket.create_connection(("127.0.0.1", self._port))
        for end in (publisher, car):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=self._forward, args=(car, publisher, lambda _: None), daemon=True).start()
        self._forward(publisher, car, self._note)

    def _note(self, size_b: int) -> None:
        if size_b > SCAN_B:
            self.given_s.append(time.monotonic())

    @staticmethod
    def _forward(source: socket.socket, target: socket.socket, note: Callable[[int], None]) -> None:
        with contextlib.suppress(OSError):
            while chunk := source.recv(READ_B):
                target.sendall(chunk)
                note(len(chunk))
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_RDWR)  # the end of one connection is that of the other


class TopicPort(LidarPort):
    """A port of the bench whose scans are published."""

    def __init__(self, course: BenchScans) -> None:
        super().__init__(course.model)  # a door that nothing knocks at
        self.settings = ("lidar.driver=topic", "ros2.enabled=true")
        beams = course.ranges_mm[: len(course.free)].astype(np.float32) / 1000
        self._beams_m = dict(zip(course.free, beams, strict=True))
        self._sent = 0
        self._session: zenoh.Session | None = None
        self._publisher: zenoh.Publisher | None = None

    @property
    def streaming(self) -> bool:
        """Return whether the session is open."""
        return self._publisher is not None

    def open(self, endpoint: str) -> None:
        """Publish at an endpoint from now on."""
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(client_config(endpoint, None))))
        self._publisher = self._session.declare_publisher(KEY)

    def block(self, picture: Picture, stamp_ms: int) -> bytes:
        """Return the message of a sweep that ends then (monotonic)."""
        at_s, beams_m = stamp_ms / 1000, self._beams_m[picture]
        first_rad = -STEP_RAD * (beams_m.size // 2)
        scan = Scan(at_s, at_s, first_rad, STEP_RAD, 0.02, 30.0, beams_m, self._sent, 1 / RATE_HZ / BEAMS_A_TURN)
        return ros_laser_scan(time.time_ns() + round((at_s - time.monotonic()) * 1e9), scan, 1 / RATE_HZ)

    def send(self, block: bytes) -> None:
        """Publish a scan."""
        self._sent += 1
        if self._publisher is not None:
            self._publisher.put(block, attachment=attachment(self._sent, time.time_ns(), b"b" * 16))

    def close(self) -> None:
        """End the session as well."""
        super().close()
        if self._session is not None:
            self._session.close()


class TopicRig(Rig):
    """A car whose scans are published by `topic`."""

    def lidar_port(self) -> TopicPort:
        """Return the publisher."""
        self.topic = TopicPort(self._course)
        return self.topic


def built_in(course: BenchScans, scans: int) -> dict[str, float]:
    """Return the figures of the Hokuyo over TCP, in ms."""
    with Rig(course) as rig:
        rig.start()
        rig.feed([False] * WARM_UP_SCANS, RATE_HZ)
        return pair(rig.feed([False] * scans, RATE_HZ), rig.commands).figures_ms()


def published(course: BenchScans, scans: int, *, forwarded: bool) -> dict[str, float]:
    """Return the figures of the topic, in ms, from `put` or from the kernel's last byte."""
    with TopicRig(course) as rig:
        give_up_s = time.monotonic() + 20
        while not is_taken(rig.endpoint):
            if time.monotonic() > give_up_s:
                raise BenchError(f"the car did not listen; it said:\n{rig.log}")
            rig.ports.serve_once(0.05)
        forwarder = Forwarder(int(rig.endpoint.rpartition(":")[2])) if forwarded else None
        rig.topic.open(forwarder.endpoint if forwarder else rig.endpoint)
        rig.start()
        rig.feed([False] * WARM_UP_SCANS, RATE_HZ)
        sent = rig.feed([False] * scans, RATE_HZ)
        if forwarder is not None:
            given_s = forwarder.given_s[-scans:]
            sent = [replace(scan, at_s=at_s) for scan, at_s in zip(sent, given_s, strict=True)]
        return pair(sent, rig.commands).figures_ms()


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all by turns, and print a line for each round and one of medians."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=12.0)
    options = parser.parse_args(arguments)
    course = make_course(scans=800, blocked=False)
    scans, rounds = round(options.seconds * RATE_HZ), list[tuple[float, ...]]()
    print("built-in p50, p99 ms | put / built-in p50, p99 | kernel / built-in p50, p99", flush=True)
    for _ in range(options.rounds):
        base = built_in(course, scans)
        ways = [published(course, scans, forwarded=forwarded) for forwarded in (False, True)]
        names = ("p50", "p99")
        rounds.append((*(base[name] for name in names), *(way[name] / base[name] for way in ways for name in names)))
        print(*(f"{figure:.3f}" for figure in rounds[-1]), flush=True)
    print("median", *(f"{statistics.median(column):.3f}" for column in zip(*rounds, strict=True)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
