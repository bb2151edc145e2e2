"""A car by servo pulses as a calibration drives it: pulses out; way and speed by the scans in place of a motor's."""

import cmath
import math
from collections import deque
from collections.abc import Mapping
from typing import Protocol, Self

import numpy as np

from wallride.clients.calibration.link import HeldDeadman, LetGoError
from wallride.clients.calibration.pulse_ways import BACK_M, GENTLE_US, NO_BRAKE
from wallride.clients.calibration.steps import lidar_place_m, sideways
from wallride.clients.calibration.ways import CalibrationError
from wallride.drivers.api import Scan
from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.pwm.throttle import Throttle, steering_rad, steering_us
from wallride.runtime.calibration.arc_fit import TOO_PLAIN
from wallride.runtime.calibration.scan_motion import STILL, ScanChain
from wallride.runtime.calibration.stop_match import MAX_RANGE_M, tells_way
from wallride.runtime.calibration.trace import TraceBuilder
from wallride.runtime.settings.tree import Settings

EVERY_S = 0.04
"""Minimum time between two scans that are taken: more tell no more, and cost time."""
SPEED_OVER_S, STANDS_OVER_S, STANDS_M = 0.15, 0.3, 0.012
"""Time over which a speed is taken; time and way within which a car that is to stop counts as standing."""
AT_NEUTRAL_US, SIDEWAYS_M = 5.0, 0.03
"""Distance from neutral of a pulse that drives; way across in STANDS_OVER_S that more than noise shows."""
MAX_MPS = 1.8
TOO_FAST = (
    "the car drove {:.1f} m/s at {:.0f} us, faster than a calibration may: limit the ESC's power, or correct"
    " motor.forward_us and motor.throttle_us_per_mps and begin again"
)


class OpenBench(Protocol):
    """Lidar and board of a car."""

    def open(self, steering_us: float, neutral_us: float) -> None:
        """Open both; CalibrationError with the remedy where one of them is away."""

    def write(self, steering_us: float, throttle_us: float, neutral_us: float) -> tuple[float, float]:
        """Write pulses [us] for a moment, neutral after it; return what the board makes of them."""

    def next_scan(self) -> Scan:
        """Wait for a scan; CalibrationError where lidar or board is lost."""

    def close(self, stop_us: float, neutral_us: float) -> None:
        """Stop by this pulse [us] for a moment, then neutral; close both. Does nothing where they are not open."""


class PulseLink:
    """Implements PulsedCar, within a `with` block. settings: of its file; now: the values in effect."""

    def __init__(self, bench: OpenBench, deadman: HeldDeadman, settings: Settings, now: Mapping[str, float]) -> None:
        self.seen = TraceBuilder()
        self._bench, self._deadman = bench, deadman
        if not isinstance(settings.motor, PwmSettings):
            raise CalibrationError(f"motor.driver = {settings.motor.driver}: this is about servo pulses")
        self._base: PwmSettings = settings.motor
        self._chain: ScanChain | None = None
        self._pose, self._way_m = STILL, 0.0
        self._now_s = -math.inf
        self._lidar_m, self._lidar_yaw_rad = complex(*lidar_place_m(now)), now["lidar.yaw_rad"]
        self._place_m = 0j  # ways of the rear axle along and across
        self._places_m: deque[complex] = deque(maxlen=round(STANDS_OVER_S / EVERY_S))
        self._asked_mps: float | None = None
        self._most_m, self._drove_back = 0.0, False
        self.use(now, gentle=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bench.close(self._throttle.last_us(), self._settings.neutral_us)

    @property
    def now_s(self) -> float:
        """Return the time of the newest scan."""
        return self._now_s

    def use(self, now: Mapping[str, float], *, gentle: bool) -> None:
        """Drive by these settings from here on, with a car that stands in neutral."""
        known = {name.removeprefix("motor."): value for name, value in now.items() if name.startswith("motor.")}
        settings = self._base.model_copy(update=known)
        if gentle:
            brakes_us = settings.reverse_us + math.copysign(GENTLE_US, settings.reverse_us - settings.neutral_us)
            settings = settings.model_copy(update={"brake_us": brakes_us})
        self._settings, self._throttle = settings, Throttle(settings)
        self._throttle.begin(self._now_s)
        self.throttle_us, self._steering_us = settings.neutral_us, settings.steering_center_us

    def forget(self) -> None:
        """Begin: open lidar and board, in neutral until the ESC is armed; CalibrationError where scans tell no way."""
        self._bench.open(self._steering_us, self._settings.neutral_us)
        self.wait()
        begin_s = self._now_s
        while self._now_s - begin_s < self._settings.arming_s:
            self.pulse(self._settings.neutral_us)
            self.wait()
        if not tells_way(self.seen.kind, np.array([ranges_m for _, ranges_m in self.seen.scans])):
            raise CalibrationError(TOO_PLAIN)
        self._throttle.begin(self._now_s)

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Ask for a drive until the next call, while the deadman is held."""
        self._asked_mps = speed_mps
        self._steering_us = steering_us(self._settings, steering_rad)
        self.seen.commands.append((self._now_s, speed_mps, steering_rad))
        self._write(self._throttle.pulse_us(speed_mps, self.seen.motor[-1][2], self._now_s))

    def pulse(self, throttle_us: float) -> None:
        """Give the ESC a pulse [us], the wheels straight."""
        self._asked_mps = None
        self._steering_us = self._settings.steering_center_us
        self._write(throttle_us)

    def release(self) -> None:
        """Let go: neutral, also while nothing is sent."""
        self._asked_mps, self.throttle_us = 0.0, self._settings.neutral_us
        self._bench.write(self._steering_us, self.throttle_us, self.throttle_us)

    def wait(self) -> None:
        """Take the next scan."""
        scan = self._bench.next_scan()
        while scan.stamp_s - self._now_s < EVERY_S:
            scan = self._bench.next_scan()
        self._take(scan)
        self._check()

    def _write(self, throttle_us: float) -> None:
        if not self._deadman.is_held():
            raise LetGoError("let go: the car stops")  # the end of the block brakes
        self._steering_us, self.throttle_us = self._bench.write(
            self._steering_us, throttle_us, self._settings.neutral_us
        )

    def _take(self, scan: Scan) -> None:
        seen, ranges_m = self.seen, scan.ranges_m.astype(np.float64)
        seen.kind = scan.angle_min_rad, scan.angle_step_rad, ranges_m.size
        seen.sweep_s = abs(scan.ray_s) * (ranges_m.size - 1)
        seen.scans.append((scan.stamp_s, scan.ranges_m))
        self._chain = self._chain or ScanChain(seen.kind, MAX_RANGE_M)
        pose = self._chain.take(scan.stamp_s, ranges_m)
        turn_rad = pose[2] - self._pose[2]
        along_rad = self._pose[2] + turn_rad / 2
        moved_m = complex(pose[0] - self._pose[0], pose[1] - self._pose[1]) * cmath.exp(-1j * along_rad)
        self._place_m += moved_m - 1j * turn_rad * self._lidar_m
        self._way_m = self._place_m.real
        self._places_m.append(self._place_m)
        self._pose, self._now_s = pose, scan.stamp_s
        angle_rad = steering_rad(self._settings, self._steering_us)
        seen.motor.append((scan.stamp_s, self._way_m, self._speed_mps(), angle_rad))

    def _speed_mps(self) -> float:
        """Return the speed; exactly 0 of a car that stands and is to."""
        moved_m, _ = self._moved(STANDS_OVER_S)
        if not self._asked_mps and abs(moved_m) < STANDS_M:
            return 0.0
        moved_m, over_s = self._moved(SPEED_OVER_S)
        return moved_m / over_s

    def _moved(self, over_s: float) -> tuple[float, float]:
        """Return the way [m] since about this time [s] ago, and the time."""
        for at_s, way_m, _, _ in reversed(self.seen.motor):
            if self._now_s - at_s >= over_s - EVERY_S / 2:
                return self._way_m - way_m, self._now_s - at_s
        return 0.0, over_s

    def _check(self) -> None:
        """CalibrationError for a car that is much too fast, goes sideways, or is driven backward by its brake."""
        speed_mps, asked = self.seen.motor[-1][2], self._asked_mps
        moved_m = self._places_m[-1] - self._places_m[0]
        drives = abs(self.throttle_us - self._settings.neutral_us) > AT_NEUTRAL_US
        if drives and abs(moved_m.imag) > max(SIDEWAYS_M, abs(moved_m.real)):
            raise CalibrationError(sideways(cmath.phase(moved_m), self._lidar_yaw_rad))
        if abs(speed_mps) > MAX_MPS:
            raise CalibrationError(TOO_FAST.format(abs(speed_mps), self.throttle_us))
        if asked is None or asked < 0:
            self._drove_back = True
        elif asked > 0 or not speed_mps:
            self._drove_back, self._most_m = False, self._way_m
        self._most_m = max(self._most_m, self._way_m)
        if not self._drove_back and self._most_m - self._way_m > BACK_M:
            raise CalibrationError(NO_BRAKE)
