"""The wall line followed from scan to scan, and with it how far off the middle the steering was mounted.

An extended Kalman filter (Welch & Bishop 2006, An Introduction to the Kalman Filter) with three states, wall on the
left: the line's distance d and heading a, both seen from the rear axle, and the trim t, the angle at which the wheels
stand while the servo stands in the middle. Over a way s the kinematic single-track model says

    turn  = s tan(wheel + t) / L          a' = a - turn          d' = d - s sin(turn / 2 - a)

so a car that turns otherwise than its steering says tells its trim within a metre or two, long before its distance from
the wall does. Tyres that slip tell the same, so in bends the model is believed less, and the trim learns nothing there.
While the servo turns the model is believed less as well, because the wheels are a scan or so behind the wire (dead
time, tyres); and the first step from a new line teaches no trim, because two lines of one scan each differ by more than
a trim turns the car. (A car that began its first turn in the second scan learnt 0.04 rad of a trim that it did not
have, and came back to the wall too wide.)
"""

import math

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.wall_following.wall_fit import CLEAN_INLIERS, WallLine

MAX_TRIM_RAD = 0.06
JUMP_M = 0.15
JUMP_RAD = 0.15
"""Minimum difference from the expected heading at which a line is another wall."""
LINE_STD_M = 0.004
LINE_STD_RAD = 0.004
"""Standard deviation of the line of one scan (noise 0.02 m: 2 mm and 0.1 deg; curved and cluttered walls are worse)."""
STEP_STD_M = 0.001
STEP_STD_RAD = 0.001
DRIFT_PER_TURN_M = 0.03
SLIP_PER_TURN = 0.3
"""Standard deviation of the model in a step: constant, and per radian turned."""
TRIM_START_STD_RAD = 0.02
TRIM_STEP_STD_RAD = 1e-4
STRAIGHT_WITHIN_MPS2 = 1.8
CALM_SHARE = 0.88
BENT_UNREST_RAD = 0.05
"""The trim learns only while the car turns with less than this lateral acceleration, and has done so for a while: per
scan the memory of the last turn falls to CALM_SHARE of itself. A bent wall counts as such a turn."""
LATE_SCANS = 1.0
"""Delay of the wheels behind the wire in scans: 20 ms of a servo's dead time, and the tyres' own."""

State = tuple[float, ...]
"""d, a and t [m, rad, rad]; their covariances dd, aa, da, dt, at, tt; then how restless the car's heading was lately
[rad], the servo's angle [rad], and 1.0 for a line that was just begun."""
START: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, TRIM_START_STD_RAD**2, 0.0, 0.0, 1.0)
"""The state before the first line."""


class WallTrack:
    """Tracks one wall; forgets it when another one is found, but never the trim."""

    def __init__(self, wheelbase_m: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._line: WallLine | None = None
        self._state: State = START

    @property
    def trim_rad(self) -> float:
        """The angle at which the wheels stand while the servo stands in the middle, as learnt."""
        return self._state[2]

    def mirror(self) -> None:
        """Change the side: another wall, but the same steering."""
        d, a, trim, *others, unrest, wheel, new = self._state
        self._state = (d, a, -trim, *others, unrest, -wheel, new)
        self._line = None

    def expect(self, way_m: float, wheel_rad: float, speed_mps: float, *, straight: bool = True) -> WallLine | None:
        """Return where the line should be after `way_m` since the last scan, None where none is tracked.

        wheel_rad: the servo's mean angle on that way. straight: whether the wall is; one that bends with the car looks
        like a car that does not turn, and tells nothing about the trim.
        """
        if self._line is None:
            return None
        unrest_rad = 0.0 if straight else BENT_UNREST_RAD
        self._state = predict_wall(self._state, way_m, wheel_rad, speed_mps, self._wheelbase_m, unrest_rad)
        return WallLine(self._state[0], self._state[1], self._line.inliers)

    def correct(self, found: WallLine | None) -> WallLine | None:
        """Take one scan's line and return the tracked one, None without a clean one."""
        if found is None or found.inliers <= CLEAN_INLIERS:
            self._line = None
            return None
        d, a, trim, *_, trim_var, unrest, wheel, _ = self._state
        same = abs(found.distance_m - d) < JUMP_M and abs(found.heading_rad - a) < JUMP_RAD
        if self._line is not None and same:
            self._state = correct_wall(self._state, found.distance_m, found.heading_rad)
        else:
            variances = LINE_STD_M**2, LINE_STD_RAD**2, 0.0, 0.0, 0.0, trim_var
            self._state = (found.distance_m, found.heading_rad, trim, *variances, unrest, wheel, 1.0)
        self._line = WallLine(self._state[0], self._state[1], found.inliers)
        return self._line


@accelerated
def predict_wall(
    state: State, way_m: float, wheel_rad: float, speed_mps: float, wheelbase_m: float, unrest_at_least_rad: float
) -> State:
    """Return the state after a way at a mean angle of the servo.

    unrest_at_least_rad: more than 0 beside a wall that bends.
    """
    d, a, trim, dd, aa, da, dt, at, tt, unrest, wheel_before, new = state
    turn_rad = way_m * math.tan(wheel_rad + trim) / wheelbase_m
    late_rad = LATE_SCANS * way_m * abs(wheel_rad - wheel_before) / wheelbase_m
    chord_rad = turn_rad / 2 - a
    unrest = max(abs(turn_rad), CALM_SHARE * max(unrest, unrest_at_least_rad))
    # P = F P F' + Q with F = [[1, s cos, 0], [0, 1, -s/L], [0, 0, 1]]; what the trim does to d at once is tiny
    along_m, by_trim = way_m * math.cos(chord_rad), -way_m / wheelbase_m
    if new or unrest * speed_mps * speed_mps > STRAIGHT_WITHIN_MPS2 * way_m:
        dt = at = by_trim = 0.0
    at_now = at + by_trim * tt
    aa_now = aa + by_trim * (at + at_now)
    da_now = da + along_m * aa + by_trim * (dt + along_m * at)
    dd += along_m * (2 * da + along_m * aa) + (STEP_STD_M + DRIFT_PER_TURN_M * abs(turn_rad)) ** 2
    dt += along_m * at
    aa_now += (STEP_STD_RAD + SLIP_PER_TURN * unrest + late_rad) ** 2
    tt = min(tt + TRIM_STEP_STD_RAD**2, TRIM_START_STD_RAD**2)
    d -= way_m * math.sin(chord_rad)
    return d, a - turn_rad, trim, dd, aa_now, da_now, dt, at_now, tt, unrest, wheel_rad, 0.0


@accelerated
def correct_wall(state: State, distance_m: float, heading_rad: float) -> State:
    """Return the state after a line was found: two scalar Kalman updates, one after the other."""
    d, a, trim, dd, aa, da, dt, at, tt, *rest = state
    share = 1.0 / (dd + LINE_STD_M**2)
    gd, ga, gt = dd * share, da * share, dt * share
    surprise = distance_m - d
    d, a, trim = d + gd * surprise, a + ga * surprise, _possible(trim + gt * surprise)
    aa, at, tt = aa - ga * da, at - ga * dt, tt - gt * dt
    dd, da, dt = dd - gd * dd, da - gd * da, dt - gd * dt
    share = 1.0 / (aa + LINE_STD_RAD**2)
    gd, ga, gt = da * share, aa * share, at * share
    surprise = heading_rad - a
    d, a, trim = d + gd * surprise, a + ga * surprise, _possible(trim + gt * surprise)
    dd, dt, tt = dd - gd * da, dt - gd * at, tt - gt * at
    aa, da, at = aa - ga * aa, da - ga * da, at - ga * at
    return d, a, trim, dd, aa, da, dt, at, tt, *rest


def _possible(trim_rad: float) -> float:
    return min(max(trim_rad, -MAX_TRIM_RAD), MAX_TRIM_RAD)
