"""Figures of a run, from the simulator's own truth: the car's real motion, not its estimate."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from wallride.runtime.control.score import STANDING_BELOW_MPS
from wallride.runtime.telemetry.screen_words import times

SETTLE_BAND_M = 0.05
SETTLED_FOR_S = 2.0
ON_THE_LINE_M = 0.02
STANDING_FOR_S = 1.0
ROUND_FROM = 1000.0
OF_THE_WALL = frozenset({"mean_abs_error_m", "rms_error_m", "settle_s", "max_overshoot_m"})
"""Figures that say nothing of a drive along a race line, or between both borders."""


@dataclass(frozen=True, slots=True)
class Sample:
    """State of the car at a moment. wall_m: true distance from the rear axle to the followed wall, inf without one."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    wall_m: float
    clearance_m: float


class DriveSums:
    """The figures of a run, summed sample by sample: however long it is, its samples need not be kept."""

    def __init__(self) -> None:
        self._first_s = 0.0
        self._last: Sample | None = None
        self._distance_m = self._moving_s = 0.0
        self._clearance_m = math.inf
        self._moved_s = -math.inf  # when it last moved
        self._counted = 0
        self._abs_m = self._square_m2 = 0.0
        self._first_error_m = self._least_m = self._most_m = 0.0
        self._settle = _Settle()

    def add(self, sample: Sample, wanted_m: float) -> None:
        """Take one sample in; wanted_m: the distance that was wanted then."""
        last, self._last = self._last, sample
        if last is None:
            self._first_s = sample.time_s
        else:
            self._distance_m += math.hypot(sample.x_m - last.x_m, sample.y_m - last.y_m)
            self._moving_s += sample.time_s - last.time_s if _moves(last) else 0.0
        self._clearance_m = min(self._clearance_m, sample.clearance_m)
        if not _moves(sample):
            return
        self._moved_s = sample.time_s
        if math.isfinite(sample.wall_m):
            self._add_error(sample.time_s, sample.wall_m - wanted_m)

    def _add_error(self, time_s: float, error_m: float) -> None:
        if not self._counted:
            self._first_error_m = self._least_m = self._most_m = error_m
        self._counted += 1
        self._abs_m += abs(error_m)
        self._square_m2 += error_m**2
        self._least_m, self._most_m = min(self._least_m, error_m), max(self._most_m, error_m)
        self._settle.add(time_s, error_m)

    @property
    def standing_s(self) -> float:
        """Return the time for which it stood [s]."""
        return self._last.time_s - self._first_s - self._moving_s if self._last is not None else 0.0

    def figures(self) -> dict[str, Any]:
        """Return duration, distance, errors, settling, clearance and speed of the run; see `figures`."""
        last, counted = self._last, self._counted
        return {
            "duration_s": rounded(last.time_s - self._first_s if last is not None else 0.0),
            "distance_m": rounded(self._distance_m),
            "mean_abs_error_m": rounded(self._abs_m / counted) if counted else None,
            "rms_error_m": rounded(math.sqrt(self._square_m2 / counted)) if counted else None,
            "settle_s": self._settle.settle_s,
            "max_overshoot_m": self._overshoot_m(),
            "min_clearance_m": rounded(self._clearance_m) if last is not None else None,
            "stopped": last is None or self._moved_s <= last.time_s - STANDING_FOR_S,
            "mean_speed_mps": rounded(self._distance_m / self._moving_s) if self._moving_s > 0 else 0.0,
        }

    def _overshoot_m(self) -> float | None:
        """Return the overshoot past the desired distance, seen from the side on which the car started.

        A car that starts on the line has no side: for it every departure counts.
        """
        if not self._counted:
            return None
        if abs(self._first_error_m) < ON_THE_LINE_M:
            return rounded(max(-self._least_m, self._most_m))
        return rounded(max(0.0, -self._least_m if self._first_error_m > 0 else self._most_m))


class _Settle:
    """Looks for the first time from which the error stays within the band for long enough."""

    def __init__(self) -> None:
        self.settle_s: float | None = None
        self._first_s: float | None = None
        self._since_s: float | None = None

    def add(self, now_s: float, error_m: float) -> None:
        if self._first_s is None:
            self._first_s = now_s
        if abs(error_m) > SETTLE_BAND_M:
            self._since_s = None
            return
        self._since_s = now_s if self._since_s is None else self._since_s
        if self.settle_s is None and now_s - self._since_s >= SETTLED_FOR_S:
            self.settle_s = rounded(self._since_s - self._first_s)


def figures(samples: Iterable[Sample], desired_m: float) -> dict[str, Any]:
    """Return duration, distance, errors, settling, clearance and speed of a run.

    Errors count while the car moves, over samples that have a wall. `settle_s` is the time after which the error
    first stays within 5 cm for 2 s; a later corner does not count. It is null when it never does.
    """
    sums = DriveSums()
    for sample in samples:
        sums.add(sample, desired_m)
    return sums.figures()


def _moves(sample: Sample) -> bool:
    return abs(sample.speed_mps) > STANDING_BELOW_MPS


def rounded(value: float, digits: int = 4) -> float | None:
    """Return a number fit for a file; None for NaN and infinity."""
    return round(float(value), digits) if math.isfinite(value) else None


def digits(value: float) -> str:
    """Return a figure for people, with as many digits as a drive repeats; a file has all of them."""
    return f"{value:.0f}" if abs(value) >= ROUND_FROM else f"{value:.3g}"


def device_counts(status: Mapping[str, Any]) -> dict[str, int]:
    """Return what the devices counted, by name: `lidar.checksum`, `motor.reconnect`."""
    return {
        f"{device}.{what}": count
        for device in ("lidar", "motor")
        for what, count in ((status.get(device) or {}).get("counts") or {}).items()
        if isinstance(count, int) and count
    }


def count_words(name: str, count: int) -> str:
    """Return a count in words: "motor missed reply 3 times"."""
    return f"{name.replace('.', ' ').replace('_', ' ')} {times(count)}"


def device_faults(status: Mapping[str, Any]) -> dict[str, int]:
    """Return what the devices counted, and the motor's fault, by name."""
    faults = device_counts(status)
    if status.get("fault"):
        faults[f"motor: {status['fault']}"] = 1
    return faults
