"""A lidar by a driver of the user: every scan is checked before the car sees it, and silence is told."""

import threading
import time
from collections.abc import Callable
from typing import Any, Final, Never

import numpy as np

from wallride.drivers.api import Clock, Health, LinkState, Scan
from wallride.drivers.link import Tap
from wallride.drivers.scan_check import NUMBERS, ScanCheck
from wallride.runtime.own_drivers.driver_class import load_driver
from wallride.runtime.own_drivers.running import DriverRun
from wallride.runtime.own_drivers.settings import OwnLidarSettings

FIRST_SCAN_S: Final = 6.0
"""Maximum time from READY, or from the start, to the first scan."""


class OwnLidar:
    """A `Lidar` (see wallride.drivers.api) around the user's. Counted in `health`: stale, restart."""

    def __init__(self, settings: OwnLidarSettings, *, clock: Clock = time.monotonic) -> None:
        self._run = DriverRun(load_driver("lidar", settings.driver), settings.own, clock)
        self._settings, self._clock = settings, clock
        self._check = ScanCheck()
        self._thread = threading.get_ident()
        self._stale = self._sequence = 0
        self._scan_s: float | None = None
        self._late_s = 0.0
        self._started_s = clock()
        self.tap: Tap | None = None
        self.reading_s = 0.0

    @property
    def left_behind(self) -> bool:
        """Whether the driver did not end when it was cancelled."""
        return self._run.left_behind

    @property
    def health(self) -> Health:
        """What the driver says of itself, unless it is wrong, or silent."""
        said = self._run.health()
        said.counts |= {"stale": self._stale, "restart": self._run.faults}
        if said.link is LinkState.READY and (silent := self._silence()):
            said.link = LinkState.FAULTY
            said.message = said.trouble = f"{self._run.driver.name}: {silent}"
        return said

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver scans without end; see `Lidar`."""
        await self._run.keep(lambda made: self._begin(made, on_scan))
        raise AssertionError("unreachable: it has no end")

    def _begin(self, made: Any, on_scan: Callable[[Scan], None]) -> Any:  # noqa: ANN401 - the user's
        self._check, self._scan_s, self._started_s = ScanCheck(), None, self._clock()
        self._thread = threading.get_ident()

        def deliver(scan: Scan) -> None:
            if self._run.made is made and not self._run.fault:  # not from an object that was given up
                self._deliver(scan, on_scan)

        return made.run(deliver)

    def _deliver(self, scan: Scan, on_scan: Callable[[Scan], None]) -> None:
        now_s = self._clock()
        if threading.get_ident() != self._thread:
            self._run.refuse("delivered a scan from another thread: use loop.call_soon_threadsafe")
        elif fault := self._check.fault(scan, now_s):
            self._run.refuse(fault)
        else:
            self._late_s = now_s - scan.stamp_s
            if self._late_s > self._settings.stale_after_s:
                self._stale += 1
                return
            self._scan_s = now_s
            numbers: dict[str, Any] = {name: float(getattr(scan, name)) for name in NUMBERS}  # they may be numpy's
            own = Scan(**numbers, ranges_m=np.array(scan.ranges_m), sequence=self._sequence)
            own.ranges_m.flags.writeable = False  # the driver may use its array again
            self._sequence += 1
            self._run.ours(lambda: on_scan(own))

    def _silence(self) -> str:
        """Return that no scan came, as words; "" where one did."""
        since_s = self._clock() - (self._started_s if self._scan_s is None else self._scan_s)
        if since_s <= (FIRST_SCAN_S if self._scan_s is None else self._settings.degraded_after_s):
            return ""
        if self._late_s > self._settings.stale_after_s:
            return f"no usable scan for {since_s:.1f} s; the last came {self._late_s:.2f} s late"
        return self._run.silent(f"no scan for {since_s:.1f} s", since_s)
