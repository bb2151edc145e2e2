"""Where the car is on its map, scan by scan: found, kept, lost and found again; never guessed."""

import cmath
import math
from collections import deque
from collections.abc import Iterator
from enum import StrEnum
from typing import Final, Self

from wallride.drivers.api import MotorState, Scan
from wallride.drivers.value import value
from wallride.runtime.control.localization.line_field import LineField
from wallride.runtime.control.localization.place_search import ALIKE, Place, PlaceSearch
from wallride.runtime.control.localization.pose_filter import Fit, PoseFilter, WheelStep
from wallride.runtime.control.localization.scan_points import AxleMotion, ScanPoints, scan_points
from wallride.runtime.control.localization.turn_check import TurnCheck
from wallride.runtime.control.localization.wheel_steps import LONGEST_S, WheelSteps
from wallride.runtime.control.vehicle import CarSettings

LOST_SHARE, LOST_SCANS = 0.5, 6
"""Share of beams on a wall below which a scan contradicts the pose, and so many in a row that the pose is lost."""
LEAST_BEAMS: Final = 15
"""Scans with fewer beams are no evidence: a covered lidar says nothing of the place."""
FOUND_SCORE, SURE_SCORE = 0.55, 0.9
"""Least nearness of a place that is found: 0.85 to 0.98 where nothing has changed since the map, 0.65 with people over
half of the view. Above the second one a place that was told needs no comparison with others: elsewhere in its
corridor, turned round, in one as wide, or in a corner that looks like it, a car has up to 0.89 there."""
PLACED_M, PLACED_RAD = 0.3, math.radians(3.0)
"""Standard deviations of a place that was found: along a corridor it may be off by as much."""
AGAIN_S, AGAIN_M = 2.0, 0.5
"""A search without a result, or with two, is begun again after this time and way."""


class Whereabouts(StrEnum):
    """What is known of the place."""

    SEARCHING = "searching"
    AMBIGUOUS = "ambiguous"
    LOCATED = "located"
    LOST = "lost"


@value()
class PoseEstimate:
    """The rear axle on the map at a scan's stamp: x [m], y [m], yaw [rad]; NaN until it is located.

    std_m: standard deviation of the position in its worst direction; std_rad: of the heading. share: of the beams that
    fit the map. alike: the places between which nothing decides, x, y, yaw each. turn_radps: how fast it turns. scale:
    true way over the one that the wheels report. slip_s2pm: the rear axle moves aside by that times speed^2 * turn.
    """

    stamp_s: float
    whereabouts: Whereabouts
    x_m: float = math.nan
    y_m: float = math.nan
    yaw_rad: float = math.nan
    std_m: float = math.nan
    std_rad: float = math.nan
    share: float = math.nan
    alike: tuple[tuple[float, float, float], ...] = ()
    turn_radps: float = math.nan
    scale: float = 1.0
    slip_s2pm: float = math.nan


class Localizer:
    """Tracks the pose on one map.

    `take` follows a pose that is known; `localize` also searches for one, which takes longer than an answer may wait.

    start: a pose near which the car is at first, None where nothing is known of it.
    scale: true way over reported way, as far as it is known. search_parts: how much of a search is done at each scan.
    """

    def __init__(
        self,
        field: LineField,
        car: CarSettings,
        start: tuple[float, float, float] | None,
        scale: float = 1.0,
        search_parts: int = 1,
    ) -> None:
        self._car = car
        self._search_parts = search_parts
        self._starts = [] if start is None else [start]
        self._is_first_search, self._began_m = True, math.nan  # what the wheels reported at first
        self._field = field
        self._filter = PoseFilter(field, car.wheelbase_m, scale)
        self._told: tuple[Place, PoseFilter] | None = None  # the place that was told, followed while it is doubted
        self._wheels = WheelSteps(car.steering_rate_radps)
        self._search = PlaceSearch(field, car.wheelbase_m)
        self._searching: Iterator[list[Place] | None] | None = None
        self._whereabouts = Whereabouts.SEARCHING
        self._alike: tuple[tuple[float, float, float], ...] = ()
        self._turns = TurnCheck()
        self._misfits: deque[bool] = deque(maxlen=LOST_SCANS)
        self._stamp_s = math.nan
        self._speed_mps = 0.0  # as the map has shown it last
        self._odometry = (0j, 0.0)  # place and heading since the search began
        self._newest: tuple[Scan, PoseEstimate] | None = None
        self._to_search: ScanPoints | None = None  # the newest scan, until a search has gone on with it
        self._rest_until = (-math.inf, 0.0)  # time and way from which the next search may begin

    def either_way_round(self) -> Self:
        """Have it look for a car at its start that stands there turned round, too."""
        self._starts += [(x_m, y_m, yaw_rad + math.pi) for x_m, y_m, yaw_rad in self._starts]
        return self

    @property
    def scale(self) -> float:
        """Return the true way over the reported one, as the map has shown it."""
        return self._filter.scale

    def take(self, scan: Scan, motor: MotorState | None) -> PoseEstimate:
        """Return where the car is at a scan; asked again for the newest, the same. motor: the newest report then.

        What no `localize` has searched for since the scan before is searched for first.
        """
        if self._newest is None or self._newest[0] is not scan:
            self._search_on()
            self._newest = scan, self._located(scan, motor)
        return self._newest[1]

    def localize(self, scan: Scan, motor: MotorState | None) -> PoseEstimate:
        """Return where the car is at a scan, after the next part of a search where that is not known."""
        self.take(scan, motor)
        self._search_on()
        return self.take(scan, motor)

    def _located(self, scan: Scan, motor: MotorState | None) -> PoseEstimate:
        since_s, self._stamp_s = scan.stamp_s - self._stamp_s, scan.stamp_s
        if self._starts:
            self._forget_start_of_driven(motor)
        told = self._wheels.to(scan.stamp_s, motor)
        step = told if told is not None else self._carried_on(since_s)
        ahead_mps, left_mps, turn_radps = self._filter.speeds(step)
        points = scan_points(scan, self._car.lidar_m, AxleMotion(ahead_mps, left_mps, turn_radps))
        if self._whereabouts is Whereabouts.LOCATED:
            return self._follow(scan, step, points, since_s)
        return self._look_for(scan, step, points)

    def _forget_start_of_driven(self, motor: MotorState | None) -> None:
        """Forget where the car was to be at first once it has driven, or nothing tells whether it has.

        Until then what changes its place is who carries it, and to the start: later, a place of a symmetric course that
        looks like the start may as well be the other one.
        """
        if motor is None:
            self._starts = self._starts if self._is_first_search else []
            return
        self._began_m = motor.distance_m if math.isnan(self._began_m) else self._began_m
        if abs(motor.distance_m - self._began_m) > AGAIN_M:
            self._starts = []

    def _carried_on(self, since_s: float) -> WheelStep:
        """Return the step of a car that goes on as before: no report tells how it went."""
        if not 0.0 < since_s < LONGEST_S:
            return WheelStep(0.0, 0.0, 0.0, None, slides=True)
        speed_mps = self._speed_mps / self._filter.scale
        return WheelStep(since_s, speed_mps * since_s, speed_mps, None, slides=True)

    def _follow(self, scan: Scan, step: WheelStep, points: ScanPoints, since_s: float) -> PoseEstimate:
        x_m, y_m, yaw_rad = self._filter.state[:3].tolist()
        self._filter.predict(step)
        fit = self._filter.correct(points)
        after_x_m, after_y_m, after_yaw_rad = self._filter.state[:3].tolist()
        if since_s > 0.0:
            middle_rad = yaw_rad + 0.5 * math.remainder(after_yaw_rad - yaw_rad, math.tau)
            way_m = (after_x_m - x_m) * math.cos(middle_rad) + (after_y_m - y_m) * math.sin(middle_rad)
            self._speed_mps = way_m / since_s
        self._note_turn(step, math.remainder(after_yaw_rad - yaw_rad, math.tau))
        if self._is_lost(fit) or self._turns.contradicts(fit.share):
            self._lose()
            return PoseEstimate(scan.stamp_s, Whereabouts.LOST, share=fit.share)
        return self._estimate(scan, fit.share)

    def _note_turn(self, step: WheelStep, turned_rad: float) -> None:
        if step.steering_rad is None:
            self._turns.begin()
            return
        way_m = self._filter.scale * step.way_m
        self._turns.take(way_m, turned_rad, way_m * math.tan(step.steering_rad) / self._car.wheelbase_m)

    def _is_lost(self, fit: Fit) -> bool:
        if fit.on_wall + fit.before + fit.beyond >= LEAST_BEAMS:
            self._misfits.append(fit.share < LOST_SHARE)
        return len(self._misfits) == LOST_SCANS and all(self._misfits)

    def _lose(self) -> None:
        self._whereabouts, self._searching, self._alike, self._told = Whereabouts.LOST, None, (), None
        self._rest_until = (-math.inf, 0.0)

    def _estimate(self, scan: Scan, share: float) -> PoseEstimate:
        x_m, y_m, yaw_rad = self._filter.state[:3].tolist()
        (a, b, _), (_, d, _), (_, _, turn) = self._filter.covariance[:3, :3].tolist()
        worst = 0.5 * (a + d) + math.hypot(0.5 * (a - d), b)
        return PoseEstimate(
            scan.stamp_s, self._whereabouts, x_m, y_m, yaw_rad, math.sqrt(worst), math.sqrt(turn), share,
            turn_radps=float(self._filter.state[3]), scale=self._filter.scale,
            slip_s2pm=float(self._filter.state[5]),
        )  # fmt: skip

    def _look_for(self, scan: Scan, step: WheelStep, points: ScanPoints) -> PoseEstimate:
        """Carry what a search may have found along with the car."""
        place, yaw_rad = self._odometry
        way_m = self._filter.scale * step.way_m
        turn_rad = way_m * math.tan(step.steering_rad or 0.0) / self._car.wheelbase_m
        self._odometry = (place + way_m * cmath.exp(1j * (yaw_rad + 0.5 * turn_rad)), yaw_rad + turn_rad)
        if self._told is not None:
            self._told[1].predict(step)
            self._told[1].correct(points)
        self._to_search = points
        return self._unknown(scan)

    def _search_on(self) -> None:
        """Search on, one part at each scan: a whole search takes longer than a scan may."""
        if self._newest is None or self._to_search is None:
            return
        scan, points, self._to_search = self._newest[0], self._to_search, None
        if self._searching is None:
            if points.places_m.size < LEAST_BEAMS or not self._may_search(scan):
                return
            self._odometry = (0j, 0.0)
            self._searching = self._places(points)
        for _, found in zip(range(self._search_parts), self._searching, strict=False):
            if found is not None:
                self._searching = None
                self._newest = scan, self._found(scan, found)
                return

    def _may_search(self, scan: Scan) -> bool:
        until_s, way_m = self._rest_until
        return scan.stamp_s >= until_s or abs(self._odometry[0]) > way_m > 0.0

    def _places(self, points: ScanPoints) -> Iterator[list[Place] | None]:
        """Search; where the car was told to be at first, places that look alike do not count."""
        near = [place for start in self._starts for place in self._search.around(points, *start)[:1]]
        near.sort(key=lambda place: -place.score)
        if len(near) > 1 and near[1].score >= ALIKE * near[0].score:
            near = []  # nothing tells which way round it stands
        is_first, self._is_first_search = self._is_first_search, False
        if is_first and near and near[0].score >= SURE_SCORE:
            yield near[:1]
        self._told = (near[0], self._placed(near[0])) if near else None
        for found in self._search.anywhere(points):
            is_told = found and near and near[0].score >= ALIKE * found[0].score
            yield near[:1] if is_told else found

    def _found(self, scan: Scan, places: list[Place]) -> PoseEstimate:
        """Take the one place that was found, or say which are alike."""
        told, self._told = self._told, None
        likely = [place for place in places if place.score >= max(FOUND_SCORE, ALIKE * places[0].score)]
        if len(likely) != 1:
            if self._whereabouts is not Whereabouts.LOST or likely:
                self._whereabouts = Whereabouts.AMBIGUOUS if likely else self._whereabouts
            self._alike = tuple((place.x_m, place.y_m, place.yaw_rad) for place in likely)
            self._rest_until = (scan.stamp_s + AGAIN_S, AGAIN_M)
            return self._unknown(scan)
        if told is not None and likely[0] is told[0]:
            self._filter = told[1]
        else:
            moved, turned_rad = self._odometry
            there = complex(likely[0].x_m, likely[0].y_m) + moved * cmath.exp(1j * likely[0].yaw_rad)
            blur_m = PLACED_M + 0.1 * abs(moved)
            self._filter.place(
                there.real, there.imag, likely[0].yaw_rad + turned_rad, blur_m, PLACED_RAD + 0.1 * abs(turned_rad)
            )
        self._whereabouts, self._alike = Whereabouts.LOCATED, ()
        self._misfits.clear()
        self._turns.begin()
        self._speed_mps = 0.0
        return self._estimate(scan, likely[0].score)

    def _placed(self, place: Place) -> PoseFilter:
        followed = PoseFilter(self._field, self._car.wheelbase_m, self._filter.scale)
        followed.place(place.x_m, place.y_m, place.yaw_rad, PLACED_M, PLACED_RAD)
        return followed

    def _unknown(self, scan: Scan) -> PoseEstimate:
        return PoseEstimate(scan.stamp_s, self._whereabouts, alike=self._alike)
