"""Whether the lap that a car drives has met its beginning, so that a map of it would close: a hint. Pure.

From the status and the scans that a page gets anyway: every half metre the scan is compared with all earlier ones from
which on the car has turned once round. What looks alike must do so place after place, as both ways go on and turn, and
at some places that look like no other around, because those of a corridor, or of a long bend, always look alike. Only
`wallride map` tells whether the map is good.
"""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from wallride.runtime.ros.laser_scan import LaserScan, read_laser_scan
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import Malformed

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]

STEP_M: Final = 0.5
"""Way between two places that are compared."""
MAX_PLACES: Final = 600
SECTORS: Final = 60
"""Directions of a place, of 6 degrees, each with its nearest range."""
SEEN_SECTORS: Final = 20
TURNS: Final = 4
"""Directions by which a place may be seen turned."""
ALIKE_M: Final = 0.2
"""Largest median difference of two places' ranges, and twice that of the most similar 80 %."""
MOST_SHARE: Final = 0.8
LAP_M: Final = 6.0
"""Least way of a lap."""
ROUND_RAD: Final = (math.tau - 1.2, math.tau + 1.2)
"""Turn of a lap, with what an odometry without a gyro drifts on it."""
MET_PLACES: Final = 8
"""Places one after the other that look like those a lap ago."""
MISS_PLACES: Final = 2
"""By so much a place that does not shortens a run of them."""
TURNS_ALIKE_RAD: Final = 0.25
"""Difference of what the car turned on a run and a lap ago."""
SHARP_PLACES: Final = 6
"""Places of a run, at least, that do not look like those APART_PLACES before and behind either: corners do not."""
APART_PLACES: Final = 3
JUMP_M: Final = 2.0
"""Way between two statuses from which on the odometry has begun anew."""


class LapWatch:
    """Takes what a car tells while it drives. way_m: since the lap began."""

    def __init__(self) -> None:
        self._recording = ""
        self._forget()

    def _forget(self) -> None:
        """Begin a lap here."""
        self._pose: tuple[float, ...] | None = None
        self.way_m = self._turned_rad = self._due_m = 0.0
        self._count = 0
        self._profiles: Floats = np.empty((MAX_PLACES, SECTORS))
        self._ways_m, self._turns_rad, self._lap_rad = np.empty((3, MAX_PLACES))
        self._runs, self._sharp = np.zeros((2, MAX_PLACES), dtype=int)
        self._closed_m: float | None = None

    @property
    def words(self) -> str:
        """Return how the lap stands, as a sentence."""
        if self.way_m < LAP_M:
            return ""
        if self._closed_m is not None:
            return f"The lap met its beginning after {self._closed_m:.0f} m, a corner included: stop when you like."
        if self._runs[: self._count].max(initial=0) >= MET_PLACES:
            return f"The lap meets its beginning, after {self.way_m:.0f} m: drive on, round one more corner."
        return f"{self.way_m:.0f} m of way; the beginning of the lap has not come in sight again."

    @property
    def is_closed(self) -> bool:
        """Return whether the lap has met its beginning, at a corner too."""
        return self._closed_m is not None

    def take(self, topic: str, payload: bytes) -> None:
        """Take a sample of a topic; one that cannot be read is left out."""
        try:
            if topic == topics.STATUS:
                self.take_status(topics.decode(payload))
            elif topic == topics.SCAN and self.way_m >= self._due_m and self._closed_m is None:
                self.take_scan(read_laser_scan(payload))
        except (AttributeError, Malformed, OverflowError, TypeError, ValueError, KeyError):
            return

    def take_status(self, status: Mapping[str, Any]) -> None:
        """Take the odometry and the name of the recording, with which a lap begins."""
        odom, recording = status["odom"], str((status.get("recording") or {}).get("file") or "")
        pose = tuple(float(odom[name]) for name in ("x_m", "y_m", "yaw_rad"))
        if recording and recording != self._recording:
            self._recording = recording
            self._forget()
        if not all(map(math.isfinite, pose)):
            return
        before, self._pose = self._pose, pose
        if before is None:
            return
        moved_m = math.hypot(pose[0] - before[0], pose[1] - before[1])
        if moved_m > JUMP_M:
            self._forget()
            return
        self.way_m += moved_m
        self._turned_rad += math.remainder(pose[2] - before[2], math.tau)

    def take_scan(self, scan: LaserScan) -> None:
        """Compare a place with the earlier ones, and keep it."""
        self._due_m, here, count = self.way_m + STEP_M, profile(scan), self._count
        self._go_on(*self._look(here))
        if np.any((self._runs[:count] >= MET_PLACES) & (self._sharp[:count] >= SHARP_PLACES)):
            self._closed_m = self.way_m
        if count < MAX_PLACES:
            self._profiles[count] = here
            self._ways_m[count], self._turns_rad[count] = self.way_m, self._turned_rad
            self._runs[count] = self._sharp[count] = self._lap_rad[count] = 0
            self._count += 1

    def _look(self, here: Floats) -> tuple[Booleans, Booleans]:
        """Tell which places a lap ago look like this one, and which of them alone of those around, (count,) each."""
        count = self._count
        round_rad = np.abs(self._turned_rad - self._turns_rad[:count])
        is_lap = self._ways_m[:count] <= self.way_m - LAP_M
        is_lap &= (round_rad >= ROUND_RAD[0]) & (round_rad <= ROUND_RAD[1])
        if not is_lap.any():
            return is_lap, is_lap
        looks = differences(here, self._profiles[:count]) <= ALIKE_M
        around = np.pad(looks, APART_PLACES, constant_values=True)  # what is not known may look alike
        is_like = looks & is_lap
        return is_like, is_like & ~around[: -2 * APART_PLACES] & ~around[2 * APART_PLACES :]

    def _go_on(self, is_like: Booleans, is_sharp: Booleans) -> None:
        """Lengthen the runs that end at each earlier place, which have come from it or from one of both before it.

        On a run the car turns as it did a lap ago: the turn of the lap stays.
        """
        count = self._count
        lap_rad = self._turned_rad - self._turns_rad[:count]
        froms = np.clip(np.arange(count) - np.arange(3)[:, None], 0, None)
        runs = np.where(np.abs(lap_rad - self._lap_rad[froms]) <= TURNS_ALIKE_RAD, self._runs[froms], 0)
        best = np.argmax(runs, axis=0), np.arange(count)
        runs, goes_on = runs[best], runs[best] > 0
        self._sharp[:count] = np.where(goes_on, self._sharp[froms][best], 0) + is_sharp
        self._lap_rad[:count] = np.where(goes_on, self._lap_rad[froms][best], lap_rad)
        self._runs[:count] = np.where(is_like, runs + 1, np.maximum(runs - MISS_PLACES, 0))


def profile(scan: LaserScan) -> Floats:
    """Return the nearest range in each direction, (SECTORS,) [m]; NaN where nothing is seen."""
    bearings_rad = scan.angle_min_rad + scan.angle_step_rad * np.arange(len(scan.ranges_m))
    sectors = np.floor(bearings_rad / math.tau * SECTORS).astype(int) % SECTORS
    ranges_m = np.where(np.isfinite(scan.ranges_m), scan.ranges_m, np.inf).astype(np.float64)
    nearest: Floats = np.full(SECTORS, np.inf)
    np.minimum.at(nearest, sectors, ranges_m)
    return np.where(np.isfinite(nearest), nearest, np.nan)


def differences(one: Floats, others: Floats) -> Floats:
    """Return how far profiles are from another one, (k,) [m]; infinity where they have too little in common.

    The least of all small turns of the car: it does not stand as it did, nor in the same place.
    """
    turned = np.stack([np.roll(one, shift) for shift in range(-TURNS, TURNS + 1)])
    apart_m = np.sort(np.abs(others[:, None, :] - turned), axis=2)  # NaN last
    seen = np.isfinite(apart_m).sum(axis=2)[..., None]
    half, most = ((share * np.maximum(seen - 1, 0)).astype(int) for share in (0.5, MOST_SHARE))
    off_m = np.maximum(np.take_along_axis(apart_m, half, 2), 0.5 * np.take_along_axis(apart_m, most, 2))
    least_m: Floats = np.where(seen >= SEEN_SECTORS, off_m, np.inf).min(axis=(1, 2))
    return least_m
