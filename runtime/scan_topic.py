"""A lidar whose scans come from another program: sensor_msgs/LaserScan over the car's zenoh session.

Its scans are judged by the rules of ROS 2's drive commands (wallride.runtime.teleop.ros_drive): one publisher, in
order, none later than the fastest of its series. Beyond that the stamp must agree with the car's own clock, because a
constant delay is invisible to a comparison. What breaks a rule stops the car: nothing is delivered until CLEAN_S
without one.
"""

import asyncio
import math
import time
from collections.abc import Callable
from functools import partial
from typing import Final, Never

from wallride.drivers.api import Clock, Health, LinkState, Scan
from wallride.drivers.link import Tap
from wallride.drivers.scan_check import ScanCheck
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.graph import scan_source
from wallride.runtime.ros.laser_scan import LaserScan, read_laser_scan
from wallride.runtime.settings.devices import TopicLidarSettings
from wallride.runtime.teleop.rejections import Refusal
from wallride.runtime.teleop.ros_drive import DriveSeries, Stamps
from wallride.runtime.wire.ingress import MAX_INCOMING_B
from wallride.runtime.wire.network import Network
from wallride.runtime.wire.rmw_zenoh import RosGraph, read_attachment

CLEAN_S: Final = 1.0
"""Time without a broken rule after which scans are delivered again; the permit has ended before."""
CLOCK_OFF_S: Final = 2.0
"""Age from which a stamp is that of another clock, and not of a scan that waited."""
_WORDS: Final = {
    Refusal.TOO_MANY: "two publishers send scans: end one of them",
    Refusal.REPLAY: "scans come out of order or twice",
}


class TopicLidar:
    """A `Lidar` (see wallride.drivers.api) fed by `receive`. Counted in `health`: stale, refused.

    unix_ns: the computer's clock, nanoseconds since 1970. on_scan: gets the scans where `run` is not called.
    """

    def __init__(
        self,
        settings: TopicLidarSettings,
        *,
        clock: Clock = time.monotonic,
        unix_ns: Callable[[], int] = time.time_ns,
        on_scan: Callable[[Scan], None] | None = None,
    ) -> None:
        self._settings, self._unix_ns, self._clock = settings, unix_ns, clock
        self._series, self._check = DriveSeries(settings.stale_after_s), ScanCheck()
        self._on_scan = on_scan
        self._health = Health(message=f"no scan on {settings.topic} yet")
        self._fault, self._fault_s = "", -math.inf
        self._scan_s, self._late_s = -math.inf, 0.0
        self._sequence = 0
        self._newest: tuple[bytes, bytes | None] | None = None
        self._understudy: TopicLidar | None = None
        self.tap: Tap | None = None
        self.reading_s = 0.0

    @property
    def health(self) -> Health:
        """Its present condition; silence and broken rules are told as of now."""
        said, now_s = self._health, self._clock()
        said.trouble = ""
        if now_s - self._fault_s < CLEAN_S:
            said.link = LinkState.FAULTY
            said.message = said.trouble = f"{self._settings.topic}: {self._fault}"
        elif now_s - self._scan_s > self._settings.degraded_after_s and said.link is not LinkState.ABSENT:
            said.link = LinkState.FAULTY
            said.message = said.trouble = f"{self._settings.topic}: {self._silence(now_s)}"
        return said

    def listen(self, bus: Network, graph: RosGraph) -> None:
        """Subscribe to the topic, under whatever type."""
        source = scan_source(self._settings.topic)
        key = graph.data_key(source)
        bus.subscribe_prompt(key, self.receive, max_bytes=MAX_INCOMING_B)
        refuse = partial(self.refuse_other_type, key)
        bus.subscribe(graph.any_type_key(source), refuse, max_bytes=MAX_INCOMING_B)

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver scans without end; see `Lidar`."""
        self._on_scan = on_scan
        try:
            await asyncio.Event().wait()
        finally:
            self._on_scan = None
        raise AssertionError("unreachable: it has no end")

    def receive(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        """Take in one message; a wrong one is told by `health`, and raises nothing."""
        if self._on_scan is None:
            return
        self._newest = payload, attachment
        try:
            sequence, sent_ns, publisher = read_attachment(attachment or b"")
            message = read_laser_scan(payload)
        except ValueError as error:
            self._refuse(f"{error}", arrival_s)
            return
        stamps = Stamps(sent_ns / NS, message.stamp_ns / NS)
        age_s = (self._unix_ns() - message.stamp_ns) / NS - max(0.0, self._clock() - arrival_s)
        if self._waits(self._series.judge(sequence, stamps, publisher, arrival_s), age_s, arrival_s):
            return
        scan = self._scan(message, arrival_s, age_s)
        if fault := self._check.fault(scan, arrival_s, within=True):
            self._check = ScanCheck()
            self._refuse(fault, arrival_s)
        elif arrival_s - self._fault_s >= CLEAN_S:
            self._deliver(scan, self._on_scan)

    def rehearse(self) -> None:
        """Read the newest message once more, by checks of its own, without delivering it: it warms the code."""
        if self._understudy is None:
            self._understudy = TopicLidar(
                self._settings, clock=self._clock, unix_ns=self._unix_ns, on_scan=lambda _: None
            )
        if self._newest is not None:
            self._understudy.receive(*self._newest, self._clock())

    def refuse_other_type(self, own_key: str, key: str, _payload: bytes, arrival_s: float) -> None:
        """Refuse what comes on the topic under another type or type hash than own_key's."""
        if key != own_key:
            self._refuse("another type or ROS 2 distribution publishes there", arrival_s)

    def _waits(self, refused: Refusal | None, age_s: float, arrival_s: float) -> bool:
        """Tell whether a scan is not for use, having counted it or stopped the car."""
        if refused in _WORDS:
            self._refuse(_WORDS[refused], arrival_s)
        elif age_s > CLOCK_OFF_S:
            self._refuse(f"stamps are {age_s:.0f} s behind the car's clock: synchronize the clocks", arrival_s)
        elif refused is Refusal.STALE or age_s > self._settings.stale_after_s:
            self._late_s = age_s
            self._health.count("stale")
        elif refused is None:
            return False
        return True

    def _scan(self, message: LaserScan, arrival_s: float, age_s: float) -> Scan:
        self._sequence += 1
        return Scan(
            arrival_s - age_s, arrival_s, message.angle_min_rad, message.angle_step_rad, message.range_min_m,
            message.range_max_m, message.ranges_m, self._sequence, message.ray_s,
        )  # fmt: skip

    def _deliver(self, scan: Scan, on_scan: Callable[[Scan], None]) -> None:
        self._scan_s, self._late_s = scan.received_s, 0.0
        self._health.link = LinkState.READY
        self._health.message = self._health.identity = f"{self._settings.topic}, {scan.ranges_m.size} beams"
        on_scan(scan)

    def _refuse(self, words: str, arrival_s: float) -> None:
        self._health.count("refused")
        self._fault, self._fault_s = words, arrival_s

    def _silence(self, now_s: float) -> str:
        since_s = now_s - self._scan_s
        if self._late_s:
            return f"no usable scan for {since_s:.1f} s; the last came {self._late_s:.2f} s late"
        return f"no scan for {since_s:.1f} s"
