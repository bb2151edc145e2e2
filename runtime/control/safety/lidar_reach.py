"""The speed that a lidar allows by its range, the angle between its beams and its rate, whatever it sees. Pure.

A leg of 10 cm counts as an object from three beams on; the wider the beams are apart, the nearer it has to be. From
there the car has to stop, on a good floor, although the lidar may have looked there just before the leg appeared: two
turns pass until it is seen. With a lidar slower than 33 Hz the car also goes WAY_M at most from one scan to the next:
the follower steers by scans, and what comes toward the car is told from several.
"""

import math

from wallride.drivers.api import Scan
from wallride.runtime.arbitration.command import Verdict
from wallride.runtime.control.perception.scan_rate import USUAL_S, ScanRate
from wallride.runtime.control.safety.body import Body
from wallride.runtime.control.safety.stopping import speed_to_stop_within_mps

LEG_M, LEG_BEAMS = 0.10, 3
RANGE_SHARE = 0.8
"""Share of the sensor's own range at which dark things still return."""
TURNS = 2
WAY_M = 0.2
SPARE_M = 0.05
_SAME_SHARE = 0.1
"""Share by which a period may vary without another bound."""
UNBOUNDED = Verdict(math.inf, math.inf, "")


def sight_m(step_rad: float, range_max_m: float) -> float:
    """Return the distance at which a leg is an object for a lidar."""
    return min(LEG_M / (LEG_BEAMS * step_rad), RANGE_SHARE * range_max_m)


def reach_mps(step_rad: float, range_max_m: float, period_s: float, body: Body) -> float:
    """Return the highest speed for a lidar; infinity where its step is unknown (0). period_s: of its turns."""
    if not step_rad > 0.0:
        return math.inf
    car, settings = body.car, body.settings
    free_m = sight_m(step_rad, range_max_m) - (body.ahead.front_m - car.lidar_x_m) - SPARE_M
    brake_mps2 = settings.hard_share * body.grip_mps2
    stops_mps = speed_to_stop_within_mps(free_m, TURNS * period_s + settings.actuation_s, brake_mps2)
    return min(stops_mps, WAY_M / period_s) if period_s > USUAL_S else stops_mps


class LidarReach:
    """Follows the lidar in use. limit: for every drive forward. words: what bounds the car, for its status."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._key = (0.0, 0.0)
        self._period_s = 0.0
        self.limit = UNBOUNDED
        self.words: tuple[str, ...] = ()

    def tune(self, body: Body) -> None:
        """Change what the bound depends on beside the lidar."""
        self._body, self._key = body, (0.0, 0.0)

    def update(self, scan: Scan, rate: ScanRate) -> Verdict:
        """Return the limit for this scan."""
        key = scan.angle_step_rad, scan.range_max_m
        if key != self._key or abs(rate.period_s - self._period_s) > _SAME_SHARE * self._period_s:
            self._key, self._period_s = key, rate.period_s
            self._bound(scan)
        return self.limit

    def _bound(self, scan: Scan) -> None:
        step_rad, period_s = abs(scan.angle_step_rad), self._period_s
        most_mps = reach_mps(step_rad, scan.range_max_m, period_s, self._body)
        if most_mps >= self._body.car.max_speed_mps:
            self.limit, self.words = UNBOUNDED, ()
            return
        rate = f"{1 / period_s:.0f} Hz, " if period_s > 0.0 else ""
        facts = f"{rate}{math.degrees(step_rad):.2g} deg a beam, {scan.range_max_m:.0f} m"
        # The lidar looks the same way backward, where the car's own limit is lower anyway.
        self.limit = Verdict(most_mps, math.inf, f"no faster with this lidar ({facts})")
        self.words = (f"the lidar allows {most_mps:.1f} m/s: {facts}",)
