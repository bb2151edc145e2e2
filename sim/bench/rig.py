"""One `wallride run` process between the two ports, commanded and monitored as on a car, and otherwise unchanged."""

import ctypes
import gc
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, Self

from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.bench.course import BenchScans
from wallride.sim.bench.devices import LidarPort, MotorCommand, MotorPort, Ports

START_TIMEOUT_S: Final = 20.0
STOP_TIMEOUT_S: Final = 5.0
FIFO_PRIORITY: Final = 20
"""Scheduling priority of systemd/wallride.service."""
CAR: Final = "bench"
_PR_SET_PDEATHSIG: Final = 1
_SPEEDING_UP_MPS2: Final = 4.0
_BRAKING_MPS2: Final = 8.0
_SETTINGS: Final = (
    f"car.name={CAR}", "operator.permit=always", "motor.servo_min=0.1", "motor.servo_max=0.95",
    "recording.enabled=false",
)  # fmt: skip
"""Settings of a bench: no people are beside it, the linkage reaches both ends, the disk stays as it is. The rest is as
shipped; measure a recording car with `--set recording.enabled=true`."""


class BenchError(Exception):
    """Failure of the process during a measurement; the text holds its output."""


@dataclass(frozen=True, slots=True)
class SentScan:
    """A scan: start of its writing, time of its last byte in the kernel, and whether a board stood before the car."""

    begun_s: float
    at_s: float
    blocked: bool


def another_computer() -> set[int]:
    """Return the core for processes beside the car: the last one, if there are several."""
    return {max(os.sched_getaffinity(0))}


def own_computer() -> set[int]:
    """Return the cores for the car: all others.

    Sender and receiver on one core take it from each other in the middle of a write, which no lidar does; and the
    scheduler wakes the receiver where the sender is.
    """
    return os.sched_getaffinity(0) - another_computer() or another_computer()


def be_the_car(cores: set[int]) -> None:
    """Keep to these cores, and make the kernel end this process with its parent; to be called before exec."""
    os.sched_setaffinity(0, cores)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


class Rig:
    """Starts and stops everything; `feed` sends scans on time and answers the car meanwhile.

    subscribers: number of processes that subscribe to all the telemetry. telemetry: whether it is enabled. fifo: car
    and emulators are scheduled before all others, as systemd does it; PermissionError where that is not allowed.
    every_core: the car may use the emulators' core as well; else it does not use it.
    endpoint: where the car's session listens. started_s: when the process was started (monotonic). scans_sent: since
        then.
    """

    def __init__(
        self, course: BenchScans, assignments: Sequence[str] = (), *, subscribers: int = 1, telemetry: bool = True,
        fifo: bool = False, every_core: bool = False,
    ) -> None:  # fmt: skip
        self._course = course
        self._assignments = [*_SETTINGS, *assignments]
        self._count = subscribers if telemetry else 0
        self._telemetry = telemetry
        self._fifo = fifo
        self._every_core = every_core
        self.scans_sent = 0
        self._subscribers: list[subprocess.Popen[str]] = []

    def __enter__(self) -> Self:
        if self._fifo:  # first, because it may be rejected; the car inherits it
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
        self._folder = tempfile.TemporaryDirectory(prefix="wallride-bench-")
        folder = Path(self._folder.name)
        lidar = self.lidar_port()
        self.ports = Ports(lidar, MotorPort())
        self._log = folder / "log"
        (folder / "car.toml").write_text("")  # the settings of this machine's own car do not apply
        endpoint = free_endpoint()
        settings = [
            f"recording.folder={folder / 'recordings'}",
            *self._assignments,
            *lidar.settings,
            f"motor.address={self.ports.motor.address}",
            f"telemetry.enabled={str(self._telemetry).lower()}",
            f'telemetry.listen=["{endpoint}"]',
        ]
        command = [sys.executable, "-P", "-m", "wallride", "run", str(folder / "car.toml")]
        command += [part for setting in settings for part in ("--set", setting)]
        with self._log.open("wb") as log:
            self.started_s = time.monotonic()
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                preexec_fn=partial(be_the_car, os.sched_getaffinity(0) if self._every_core else own_computer()),  # noqa: PLW1509 - one thread here
            )
        self.endpoint = endpoint
        self._cores = os.sched_getaffinity(0)
        os.sched_setaffinity(0, another_computer())
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.stop()
        finally:
            self.process.kill()
            self.process.wait()
            for subscriber in self._subscribers:
                subscriber.kill()
                subscriber.communicate()
            self.ports.lidar.close()
            self.ports.motor.close()
            self._folder.cleanup()
            os.sched_setaffinity(0, self._cores)
            if self._fifo:
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))

    @property
    def log(self) -> str:
        """Return the output of the process until now."""
        return self._log.read_text(errors="replace")

    @property
    def commands(self) -> list[MotorCommand]:
        """Return the motor commands until now."""
        return self.ports.motor.commands

    def lidar_port(self) -> LidarPort:
        """Return the port of the lidar; for another kind of lidar to override."""
        return LidarPort(self._course.model)

    def start(self) -> None:
        """Wait for the stream; then start the subscribers."""
        give_up_s = time.monotonic() + START_TIMEOUT_S
        while not self.ports.lidar.streaming:
            self._check(give_up_s, "did not ask the lidar for scans")
            self.ports.serve_once(0.05)
        listen = [sys.executable, "-P", "-m", "wallride.sim.bench.subscriber", self.endpoint, CAR]
        for _ in range(self._count):
            subscriber = subprocess.Popen(listen, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            self._subscribers.append(subscriber)

    def stop_reading(self) -> None:
        """Freeze the subscribers: they stay connected and stop reading."""
        for subscriber in self._subscribers:
            subscriber.send_signal(signal.SIGSTOP)

    def feed(self, scans: Iterable[bool], rate_hz: float) -> list[SentScan]:
        """Send scans at this rate, True for a blocked one; late scans are not caught up."""
        course, ports = self._course, self.ports
        sent: list[SentScan] = []
        gc.disable()
        try:
            next_s = time.monotonic() + 1 / rate_hz
            for blocked in scans:
                pictures = course.blocked if blocked else course.free
                picture = pictures[self.scans_sent % len(pictures)]
                self._turn_wheels(picture.speed_mps, 1 / rate_hz)
                block = ports.lidar.block(picture, round(next_s * 1000))
                ports.serve_until(next_s)
                begun_s = time.monotonic()
                ports.lidar.send(block)
                sent.append(SentScan(begun_s, time.monotonic(), blocked))
                self.scans_sent += 1
                next_s = max(next_s + 1 / rate_hz, begun_s + 0.5 / rate_hz)
        finally:
            gc.enable()
        ports.serve_until(time.monotonic() + 0.05)
        self._check(time.monotonic() + 1, "")
        return sent

    def stop(self) -> int:
        """End the process as systemd would; returns the exit code. Idempotent."""
        if self.process.poll() is None:
            self.process.terminate()
        give_up_s = time.monotonic() + STOP_TIMEOUT_S
        while self.process.poll() is None and time.monotonic() < give_up_s:
            self.ports.serve_once(0.02)
        return self.process.poll() or 0

    def heard(self) -> dict[str, Any]:
        """Return the first subscriber's report: messages by topic, seconds, and the newest status; ends it."""
        if not self._subscribers:
            return {}
        out, _ = self._subscribers.pop(0).communicate("", timeout=STOP_TIMEOUT_S)
        return dict(json.loads(out))

    def _turn_wheels(self, wanted_mps: float, dt_s: float) -> None:
        """Turn the wheels as the newest command requests."""
        wheels, commands = self.ports.motor.wheels, self.commands
        if commands and commands[-1].moving:
            wheels.turn(min(wanted_mps, wheels.speed_mps + _SPEEDING_UP_MPS2 * dt_s))
        else:
            wheels.turn(max(0.0, wheels.speed_mps - _BRAKING_MPS2 * dt_s))

    def _check(self, give_up_s: float, what: str) -> None:
        if self.process.poll() is not None:
            raise BenchError(f"the car's process ended ({self.process.returncode}); it said:\n{self.log}")
        if time.monotonic() > give_up_s:
            raise BenchError(f"the car's process {what}; it said:\n{self.log}")
