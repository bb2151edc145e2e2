"""View of one scan: points in the car's frame, and which of them are obstacles.

A beam is *solid* when it has a distance, its neighbours agree (despike), it does not lie on the car itself, and it is
not dirt on the window: thin dirt by its shape in this scan, wide dirt by what `lidar_health` has learnt. Everything
else is either without an echo ("no information", never "free") or not worth a stop.

Frames: base_link = middle of the rear axle, x forward, y left (REP-105). Bearings are those of the
car, also where the lidar is mounted at an angle: the driver turns them by `lidar.yaw_rad`.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Booleans, Floats, bearings_rad, beyond, directions
from wallride.runtime.control.perception.scan_rate import ScanRate
from wallride.runtime.control.vehicle import CarSettings

SUPPORT_WITHIN_M = 0.15
"""Maximum difference in range of neighbours on the same object; 2 of 4 make a beam credible."""
NEIGHBOURS = 2
DIRT_NEARER_THAN_M = 0.6
"""Maximum range of dirt: on a window it reads as centimetres to decimetres."""
LEARNT_DIRT_NEARER_THAN_M = 0.9
"""Maximum range at which beams known to be dirty are ignored: the rim of a smudge mixes it with the wall behind."""
DIRT_STANDS_OUT_M = 0.12
"""Minimum distance by which dirt is nearer than the beams on both of its sides."""
DIRT_THINNER_THAN_M = 0.012
"""Maximum width of dirt; a real object as thin and near is not seen: the cost of starting with a smudged window."""
BODY_BEYOND_RAD = math.radians(105)
"""Bearing behind which a near return that moves with the car is a part of it; in front of it, dirt."""
DOUBTED_BEYOND_RAD = math.radians(93)
DOUBTED_NEARER_THAN_M = 0.9
"""Bearing behind which, and range below which, returns are doubted until `own_parts` attributes them to the world."""
TRAIL_STEP_M = 0.02
"""Minimum increase of the range per beam in a trail; a wall as near as the car's flank has a twentieth of it."""
RIM_BEAMS = 2
"""Number of beams beside a part that hit its edge, whatever they read; a single beam is an outlier and has no edge."""
BRIDGED_BEAMS = 2
"""Number of outliers inside a thin object that do not divide it into two thinner ones."""


@value(eq=False)
class View:
    """One interpreted scan. All arrays have shape (beams,) and are read-only by convention.

    ranges_m: float64; NaN where a beam has no distance. bearing_rad: of each beam in the lidar frame.
    x_m, y_m: end points in base_link; NaN without a distance. lidar_m: where the beams begin.
    solid: objects that can be hit or followed. no_echo: no information. own: on or in the car's own outline.
    dirty: known to be dirty, whatever they read now; None while no beam is. silent: number without an echo.
    waits_s: how much longer than at 40 Hz the next scan takes.
    """

    scan: Scan
    ranges_m: Floats
    bearing_rad: Floats
    x_m: Floats
    y_m: Floats
    solid: Booleans
    no_echo: Booleans
    own: Booleans
    lidar_m: complex
    dirty: Booleans | None
    silent: int
    waits_s: float = 0.0


Kind = tuple[float, float, int]
"""Key of one kind of lidar: first bearing, step, beams."""


@value(eq=False)
class Fan:
    """The beams of one kind of lidar, (beams,): bearing, its cosine and sine, which look behind DOUBTED_BEYOND_RAD.

    nothing_m: zeros.
    """

    bearing_rad: Floats
    cos: Floats
    sin: Floats
    aback: Booleans
    nothing_m: Floats


def fan_of(scan: Scan) -> Fan:
    """Return the beams of the lidar that took a scan."""
    kind = scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.shape[0]
    cos, sin = directions(*kind)
    return Fan(bearings_rad(*kind), cos, sin, beyond(scan, DOUBTED_BEYOND_RAD), np.zeros(kind[2]))


class ViewCache:
    """Computes the view of each scan once; shared by follower and safety. rate: of the lidar."""

    def __init__(self, car: CarSettings) -> None:
        self._car = car
        ahead_m, aback_m = car.front_m - car.lidar_x_m, car.rear_m + car.lidar_x_m
        self._own_within_m = math.hypot(max(ahead_m, aback_m), car.half_width_m + abs(car.lidar_y_m))
        self._lidar_m = car.lidar_m
        self._dirty: Booleans | None = None
        self._ignored_below_m: Floats | None = None
        self._last: View | None = None
        self._fan: tuple[Kind, Fan] | None = None
        self.rate = ScanRate()

    def ignore(self, dirty: Booleans | None, below_m: Floats | None = None) -> None:
        """Ignore these beams (n,) within the range of dirt, from the next scan on; None: ignore none.

        below_m: (n,), what any beam reads less is left out as well.
        """
        self._last = None
        self._dirty, self._ignored_below_m = dirty, below_m
        if dirty is not None and below_m is not None and dirty.shape == below_m.shape:
            self._ignored_below_m = np.maximum(below_m, dirty * LEARNT_DIRT_NEARER_THAN_M)

    def see(self, scan: Scan) -> View:
        """Return the view of a scan, computed at the first call for it."""
        if self._last is None or self._last.scan is not scan:
            self._last = self._look(scan)
        return self._last

    def _look(self, scan: Scan) -> View:
        car, sent_m = self._car, scan.ranges_m
        kind = scan.angle_min_rad, scan.angle_step_rad, sent_m.size
        if self._fan is None or self._fan[0] != kind:
            self._fan = kind, fan_of(scan)
        fan = self._fan[1]
        dirty = self._dirty if self._dirty is not None and self._dirty.size == sent_m.size else None
        ignored_below_m = self._ignored_below_m
        if ignored_below_m is None or ignored_below_m.size != sent_m.size:
            ignored_below_m = fan.nothing_m
            if dirty is not None:
                ignored_below_m = np.maximum(ignored_below_m, dirty * LEARNT_DIRT_NEARER_THAN_M)
        ranges_m, x_m, y_m, solid, no_echo, own, silent = view_scan(
            sent_m, fan, ignored_below_m, scan.angle_step_rad, car, self._own_within_m
        )
        waits_s = self.rate.note(scan.stamp_s)
        return View(
            scan, ranges_m, fan.bearing_rad, x_m, y_m, solid, no_echo, own, self._lidar_m, dirty, silent, waits_s
        )


def _flat_view(
    sent_m: npt.NDArray[np.float32],
    fan: Fan,
    ignored_below_m: Floats,
    angle_step_rad: float,
    car: CarSettings,
    own_within_m: float,
) -> tuple[Any, ...]:
    return (
        sent_m, fan.cos, fan.sin, fan.aback, ignored_below_m, angle_step_rad, car.lidar_x_m, car.lidar_y_m, car.front_m,
        car.rear_m, car.half_width_m, own_within_m,
    )  # fmt: skip


@accelerated(flat=_flat_view)
def view_scan(
    sent_m: npt.NDArray[np.float32],
    fan: Fan,
    ignored_below_m: Floats,
    angle_step_rad: float,
    car: CarSettings,
    own_within_m: float,
) -> tuple[Floats, Floats, Floats, Booleans, Booleans, Booleans, int]:
    """Return ranges_m, x_m, y_m, solid, no_echo, own and silent of a View, from the ranges as sent, (beams,).

    ignored_below_m: what reads less is not
    solid: dirt, the car's parts, and what may be one. own_within_m: no part of the car is farther from the lidar.
    """
    ranges_m = sent_m.astype(np.float64)
    echo = ranges_m > 0.0
    echo &= ranges_m < math.inf
    no_echo = ~echo
    ranges_m[no_echo] = math.nan
    x_m, y_m = fan.cos * ranges_m, fan.sin * ranges_m
    x_m += car.lidar_x_m
    y_m += car.lidar_y_m
    solid = supported(ranges_m)
    ignored = ranges_m < ignored_below_m  # NaN compares as not nearer
    solid &= ~ignored
    own = np.zeros(ranges_m.shape, np.bool_)
    index = (ranges_m < own_within_m).nonzero()[0]
    if index.size:
        near_x, aside_m = x_m[index], np.abs(y_m[index])
        mine = index[(near_x <= car.front_m) & (near_x >= -car.rear_m) & (aside_m <= car.half_width_m)]
        own[mine] = True
        solid[mine] = False
    parts = ((own | ignored) & fan.aback).nonzero()[0]
    if parts.size:
        solid[trails(ranges_m, parts)] = False
    near = ranges_m < DIRT_NEARER_THAN_M
    # Only beams that would count are checked for dirt: an outlier has no neighbours anyway.
    if np.count_nonzero(near & solid):
        solid[thin_dirt(ranges_m, near, angle_step_rad)] = False
    return ranges_m, x_m, y_m, solid, no_echo, own, int(np.count_nonzero(no_echo))


def supported(ranges_m: Floats) -> Booleans:
    """Return which beams have at least 2 of 4 neighbours (2 each side) within 0.15 m; shape (n,)."""
    beams = ranges_m.shape[0]
    # Row r, column i + r + 1: whether beams i and i + r + 1 agree. The rest stays 0: no beams are beyond the ends.
    agree = np.zeros((2, beams + 4), np.int8)
    for row, step in ((0, 1), (1, 2)):
        off_m = ranges_m[step:] - ranges_m[:-step]
        np.less_equal(
            np.abs(off_m, out=off_m), SUPPORT_WITHIN_M, out=agree[row, step : step + off_m.size].view(np.bool_)
        )
    by_one, by_two = agree
    count = by_one[:beams] + by_one[1 : beams + 1]
    count += by_two[:beams]
    count += by_two[2 : beams + 2]
    enough: Booleans = count >= NEIGHBOURS
    return enough


def trails(ranges_m: Floats, own: npt.NDArray[np.intp]) -> list[int]:
    """Return the beams beside the car's own parts that see half of the part and half of what is behind it.

    A beam that meets an edge measures something between the edge and the background ("mixed pixels", Tuley, Vandapel &
    Hebert 2005): a row of returns that leads from the car's own part away, almost along the beams. So does no real
    surface, whose extension would have to pass through the lidar.

    own: indices (k,) of the beams that see the car's own parts, or what may be one.
    """
    if not own.size:
        return []
    found: list[int] = []
    gaps = np.flatnonzero(own[1:] - own[:-1] > 1)
    firsts, lasts = own[[0, *(gaps + 1)]].tolist(), own[[*gaps, -1]].tolist()
    for first, last in zip(firsts, lasts, strict=True):
        rim = RIM_BEAMS if last > first else 0
        for edge, step in ((first, -1), (last, 1)):
            beam, far = edge + step, edge + step * rim
            while 0 <= beam < ranges_m.size and (
                (far - beam) * step >= 0 or ranges_m[beam] - ranges_m[beam - step] >= TRAIL_STEP_M
            ):
                found.append(beam)
                beam += step
    return found


def thin_dirt(ranges_m: Floats, near: Booleans, angle_step_rad: float) -> npt.NDArray[np.intp]:
    """Return the indices of near beams that form things thinner than 1.2 cm, standing out on both sides.

    A run is a row of near beams without a jump in range; at an end of the fan only the other side must be farther.
    No echo counts as far.
    """
    index: npt.NDArray[np.intp] = np.flatnonzero(near)
    near_m = ranges_m[index]
    cut = (index[1:] - index[:-1] > BRIDGED_BEAMS + 1) | (np.abs(near_m[1:] - near_m[:-1]) >= DIRT_STANDS_OUT_M)
    first = np.concatenate(([0], np.flatnonzero(cut) + 1))
    last = np.concatenate((first[1:], [index.size])) - 1
    from_beam, to_beam = index[first], index[last]
    width_m = (to_beam - from_beam + 1) * abs(angle_step_rad) * np.minimum(near_m[first], near_m[last])
    # "Not nearer than that", so that NaN, no echo, counts as far.
    left_near = ranges_m[np.minimum(to_beam + 1, ranges_m.size - 1)] - near_m[last] < DIRT_STANDS_OUT_M
    right_near = ranges_m[np.maximum(from_beam - 1, 0)] - near_m[first] < DIRT_STANDS_OUT_M
    left_near &= to_beam < ranges_m.size - 1
    right_near &= from_beam > 0
    thin = (width_m < DIRT_THINNER_THAN_M) & ~left_near & ~right_near
    if not thin.any():
        return index[:0]
    dirt: npt.NDArray[np.intp] = index[np.repeat(thin, last - first + 1)]
    return dirt
