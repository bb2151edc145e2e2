"""What a source has kept of its promises, by odometry: it decides whether the next one is believed, and how widely.

A promise is compared with where the car was then driven, and with the promise of the next scan. A source that left its
own path, or took it back, is judged by its arc until it has kept promises for a while again.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np

from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.geometry import Places, beside_path_m

REMEMBERED_S = 0.3
"""Time for which a promise is compared with the way driven: the odometry of longer ways errs itself."""
GAP_S = 0.15
"""Longest time between two promises of one series."""
KEPT_S, KEPT_WAY_M = 0.5, 1.0
"""Time and way over which a source has to keep its promises before they are believed."""
LEAST_MARGIN_M = 0.05
"""Least margin beside a promised path, whatever the source says of itself: noise of the scan and of the odometry."""
SPARE_M = 0.01
ODOMETRY_SHARE = 0.08
"""Error aside of the wheels' odometry over the way driven, in a bend at the grip's limit under the brake."""
TURN_LAG_S = 0.1
"""Lag of the yaw rate after the wheels: servo, tyres and inertia."""
FADES_S = 3.0
"""Time constant with which an error measured once is forgotten."""
AGREES_M, AGREES_RAD, TURN_ERROR_RADPM = 0.06, 0.05, 0.14
"""How far a new promise may be beside an earlier one: noise of the pose, of its heading, and the odometry's turn, which
errs by the metre: a trim of 0.02 rad is 0.06 of it, tyres of 0.7 of the usual stiffness in a bend nearly as much."""
SHIFT_M = 0.10
"""How much farther a pose that is corrected at once may shift a path: the margin is wider by that, and so covers both
paths. Beyond it the path was taken back."""

LEFT = "it left its path"
TAKEN_BACK = "it took its path back"


class DrivenPlace(NamedTuple):
    """The car at a scan, in a frame of the record's own: that of the odometry, with tyres.

    turn: its heading as a direction. turn_radps: its yaw rate. way_m: that its wheels have rolled.
    """

    stamp_s: float
    at_m: complex
    turn: complex
    turn_radps: float
    way_m: float

    def in_frame_m(self, places_m: Places) -> Places:
        """Return places (n,) of base_link in the frame."""
        return self.at_m + places_m * self.turn

    def in_base_m(self, places_m: Places) -> Places:
        """Return places (n,) of the frame in base_link."""
        return (places_m - self.at_m) * self.turn.conjugate()


class Given(NamedTuple):
    """A promise as it was given here. path_m: (n,), in its frame. margin_m: to each side."""

    here: DrivenPlace
    path_m: Places
    margin_m: float


class PromiseRecord(NamedTuple):
    """A value, of which each judgement of a scan returns the next.

    given: the last promises. here: the car at the last scan. since_s: stamp at which the series that was kept begins.
    kept_m: way driven since. off_m: largest distance from a promise, fading. refused: how many promises were not
    believed. reason: why the last one was not, "" where it was.
    """

    given: tuple[Given, ...] = ()
    here: DrivenPlace = DrivenPlace(-math.inf, 0j, 1 + 0j, 0.0, 0.0)
    since_s: float = math.inf
    kept_m: float = 0.0
    off_m: float = 0.0
    refused: int = 0
    reason: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """Why the last promise was not believed, in a sentence for the user; nothing where it was."""
        return (f"the promised path is not believed: {self.reason} ({self.refused} times)",) if self.reason else ()

    def margin_m(self, said_m: float) -> float:
        """Return the margin for a source that says this of itself."""
        return max(said_m, LEAST_MARGIN_M, self.off_m + SPARE_M)

    def trusts(self, here: DrivenPlace) -> bool:
        """Whether promises have been kept for long enough."""
        return here.stamp_s - self.since_s >= KEPT_S and self.kept_m >= KEPT_WAY_M

    def refusing(self, reason: str) -> "PromiseRecord":
        """Return the record after a promise that is not believed."""
        return self._replace(refused=self.refused + 1, reason=reason)

    def restarted(self, here: DrivenPlace, reason: str) -> "PromiseRecord":
        """Return the record of a source that has to keep promises anew."""
        return PromiseRecord(here=here, off_m=self.off_m, refused=self.refused + 1, reason=reason)

    def after(self, here: DrivenPlace, path_m: Places, said_m: float) -> "PromiseRecord":
        """Return the record after the promise of a new scan; path_m: (n,), in its frame."""
        given = tuple(one for one in self.given if here.stamp_s - one.here.stamp_s <= REMEMBERED_S)
        if not given or here.stamp_s - given[-1].here.stamp_s > GAP_S:
            new = Given(here, path_m, self.margin_m(said_m))
            return self._replace(given=(new,), here=here, since_s=here.stamp_s, kept_m=0.0, reason="")
        now_m = [_kept_m(here, one) for one in given]
        off_m = max(*now_m, self.off_m * math.exp((self.here.stamp_s - here.stamp_s) / FADES_S))
        if any(off > one.margin_m for off, one in zip(now_m, given, strict=True)):
            return self.restarted(here, LEFT)._replace(off_m=off_m)
        shift_m = max(_shift_m(here, path_m, one) for one in (given[0], given[-1]))
        if shift_m > SHIFT_M:
            return self.restarted(here, TAKEN_BACK)._replace(off_m=off_m)
        if shift_m > 0.0:
            off_m = max(off_m, LEAST_MARGIN_M + shift_m)
            given = tuple(one._replace(margin_m=max(one.margin_m, off_m + SPARE_M)) for one in given)
        new = Given(here, path_m, self._replace(off_m=off_m).margin_m(said_m))
        kept_m = self.kept_m + abs(here.way_m - given[-1].here.way_m)
        return self._replace(given=(*given, new), here=here, kept_m=kept_m, off_m=off_m, reason="")


NO_PROMISES = PromiseRecord()


class TyreModel(NamedTuple):
    """What the odometry leaves out, per lateral acceleration: the rear axle's slip, and how much more it is steered."""

    wheelbase_m: float
    slip_rad_per_mps2: float
    understeer_rad_per_mps2: float


def place_of(last: DrivenPlace, motor: MotorState, stamp_s: float, wheel_rad: float, tyres: TyreModel) -> DrivenPlace:
    """Return the car's place at a scan after the last one; wheel_rad: between the two.

    Over the odometry: the report is carried on to the scan, the rear axle slips outward, the wheels have to be steered
    more, and the car turns after them with a lag. Without these an honest source at the grip's limit leaves its path by
    8 cm in 0.15 s.
    """
    way_m = motor.distance_m + motor.speed_mps * min(max(stamp_s - motor.stamp_s, 0.0), GAP_S)
    since_s = stamp_s - last.stamp_s
    if since_s <= 0.0:
        return last
    if since_s > GAP_S:
        return DrivenPlace(stamp_s, 0j, 1 + 0j, motor.speed_mps * math.tan(wheel_rad) / tyres.wheelbase_m, way_m)
    moved_m, speed_mps = way_m - last.way_m, motor.speed_mps
    rolls_rad = wheel_rad - tyres.understeer_rad_per_mps2 * speed_mps * last.turn_radps
    asked_radps = speed_mps * math.tan(rolls_rad) / tyres.wheelbase_m
    turn_radps = asked_radps + (last.turn_radps - asked_radps) * math.exp(-since_s / TURN_LAG_S)
    middle_radps = (last.turn_radps + turn_radps) / 2
    turned = cmath.exp(1j * middle_radps * since_s)
    way = cmath.exp(1j * (middle_radps * since_s / 2 - tyres.slip_rad_per_mps2 * speed_mps * middle_radps))
    return DrivenPlace(stamp_s, last.at_m + moved_m * last.turn * way, last.turn * turned, turn_radps, way_m)


def _kept_m(here: DrivenPlace, given: Given) -> float:
    """Return how far the car is beside an earlier promise, less what the wheels' odometry may err."""
    off_m = float(beside_path_m(np.array([here.at_m]), given.path_m)[0])
    return max(0.0, off_m - ODOMETRY_SHARE * abs(here.way_m - given.here.way_m))


def _shift_m(here: DrivenPlace, path_m: Places, given: Given) -> float:
    """Return how far a new path is beside an earlier one, as far as both reach, less what pose and odometry may err."""
    apart_m = beside_path_m(path_m, given.path_m)
    way_m = abs(here.way_m - given.here.way_m)
    known_m = AGREES_M + ODOMETRY_SHARE * way_m
    angle_rad = AGREES_RAD + TURN_ERROR_RADPM * way_m
    return float((apart_m - known_m - angle_rad * np.abs(path_m - here.at_m)).max())
