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

from runtime.control.wall import CLEAN_INLIERS, Line

MOST_TRIM_RAD = 0.06
JUMP_M = 0.15
JUMP_RAD = 0.15
"""A line that is found so far from where it was expected is another wall."""
LINE_STD_M = 0.004
LINE_STD_RAD = 0.004
"""Of the line of one scan (noise 0.02 m: 2 mm and 0.1 deg; curved and cluttered walls are worse)."""
STEP_STD_M = 0.001
STEP_STD_RAD = 0.001
DRIFT_PER_TURN_M = 0.03
SLIP_PER_TURN = 0.3
"""What the model may be wrong by in a step: always, and per radian turned."""
TRIM_START_STD_RAD = 0.02
TRIM_STEP_STD_RAD = 1e-4
STRAIGHT_WITHIN_MPS2 = 1.8
CALM_SHARE = 0.88
BENT_UNREST_RAD = 0.05
"""The trim learns only while the car turns with less than this lateral acceleration, and has done so for a while: per
scan the memory of the last turn falls to CALM_SHARE of itself. A bent wall counts as such a turn."""


LATE_SCANS = 1.0
"""By so many scans the wheels are behind the wire: 20 ms of a servo's dead time, and the tyres' own."""


class WallTrack:
    """Tracks one wall; forgets it when another one is found, but never the trim."""

    def __init__(self, wheelbase_m: float) -> None:
        self._wheelbase_m = wheelbase_m
        self.trim_rad = 0.0
        self._trim_var = TRIM_START_STD_RAD**2
        self._line: Line | None = None
        self._d = self._a = 0.0
        self._unrest_rad = 0.0
        self._wheel_rad = 0.0
        self._new = True
        # Covariances: of d, a, and between them and the trim.
        self._dd = self._aa = self._da = self._dt = self._at = 0.0

    def mirror(self) -> None:
        """The wall is on the other side now: another wall, but the same steering."""
        self.trim_rad = -self.trim_rad
        self._wheel_rad = -self._wheel_rad
        self._line = None

    def expect(self, way_m: float, wheel_rad: float, speed_mps: float, *, straight: bool = True) -> Line | None:
        """Return where the line should be after `way_m` since the last scan, None where none is tracked.

        wheel_rad: the servo's mean angle on that way. straight: whether the wall is; one that bends with the car looks
        like a car that does not turn, and tells nothing about the trim.
        """
        if self._line is None:
            return None
        if not straight:
            self._unrest_rad = max(self._unrest_rad, BENT_UNREST_RAD)
        self._predict(way_m, wheel_rad, speed_mps)
        return Line(self._d, self._a, self._line.inliers)

    def correct(self, found: Line | None) -> Line | None:
        """Take one scan's line and return the tracked one, None without a clean one."""
        if found is None or found.inliers <= CLEAN_INLIERS:
            self._line = None
            return None
        same = abs(found.distance_m - self._d) < JUMP_M and abs(found.heading_rad - self._a) < JUMP_RAD
        if self._line is not None and same:
            self._correct(found)
        else:
            self._begin(found)
        self._line = Line(self._d, self._a, found.inliers)
        return self._line

    def _begin(self, found: Line) -> None:
        self._new = True
        self._d, self._a = found.distance_m, found.heading_rad
        self._dd, self._aa = LINE_STD_M**2, LINE_STD_RAD**2
        self._da = self._dt = self._at = 0.0

    def _predict(self, way_m: float, wheel_rad: float, speed_mps: float) -> None:
        turn_rad = way_m * math.tan(wheel_rad + self.trim_rad) / self._wheelbase_m
        late_rad = LATE_SCANS * way_m * abs(wheel_rad - self._wheel_rad) / self._wheelbase_m
        self._wheel_rad = wheel_rad
        chord_rad = turn_rad / 2 - self._a
        self._d -= way_m * math.sin(chord_rad)
        self._a -= turn_rad
        self._unrest_rad = max(abs(turn_rad), CALM_SHARE * self._unrest_rad)
        # P = F P F' + Q with F = [[1, s cos, 0], [0, 1, -s/L], [0, 0, 1]]; what the trim does to d at once is tiny
        along_m, by_trim = way_m * math.cos(chord_rad), -way_m / self._wheelbase_m
        turns = self._unrest_rad * speed_mps * speed_mps > STRAIGHT_WITHIN_MPS2 * way_m
        if turns or self._new:
            self._dt = self._at = 0.0
            by_trim = 0.0
        self._new = False
        at = self._at + by_trim * self._trim_var
        aa = self._aa + by_trim * (self._at + at)
        da = self._da + along_m * self._aa + by_trim * (self._dt + along_m * self._at)
        self._dd += along_m * (2 * self._da + along_m * self._aa) + (STEP_STD_M + DRIFT_PER_TURN_M * abs(turn_rad)) ** 2
        self._dt += along_m * self._at
        self._at, self._da = at, da
        self._aa = aa + (STEP_STD_RAD + SLIP_PER_TURN * self._unrest_rad + late_rad) ** 2
        self._trim_var = min(self._trim_var + TRIM_STEP_STD_RAD**2, TRIM_START_STD_RAD**2)

    def _correct(self, found: Line) -> None:
        """Both measurements, one after the other: scalar Kalman updates."""
        share = 1.0 / (self._dd + LINE_STD_M**2)
        gd, ga, gt = self._dd * share, self._da * share, self._dt * share
        self._move(gd, ga, gt, found.distance_m - self._d)
        dd, da, dt = self._dd, self._da, self._dt
        self._aa -= ga * da
        self._at -= ga * dt
        self._trim_var -= gt * dt
        self._dd, self._da, self._dt = dd - gd * dd, da - gd * da, dt - gd * dt
        share = 1.0 / (self._aa + LINE_STD_RAD**2)
        gd, ga, gt = self._da * share, self._aa * share, self._at * share
        self._move(gd, ga, gt, found.heading_rad - self._a)
        aa, da, at = self._aa, self._da, self._at
        self._dd -= gd * da
        self._dt -= gd * at
        self._trim_var -= gt * at
        self._aa, self._da, self._at = aa - ga * aa, da - ga * da, at - ga * at

    def _move(self, gd: float, ga: float, gt: float, surprise: float) -> None:
        self._d += gd * surprise
        self._a += ga * surprise
        self.trim_rad = min(max(self.trim_rad + gt * surprise, -MOST_TRIM_RAD), MOST_TRIM_RAD)
