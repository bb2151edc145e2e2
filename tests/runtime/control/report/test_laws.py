"""The report's two laws, number by number."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, scan_of
from tests.runtime.in_earnest import is_same
from wallride.drivers.api import Drive
from wallride.new.pd_follower import PdFollower, PdSettings
from wallride.runtime.control.own_laws.api import LawScan, LawState
from wallride.runtime.control.report.laws import ReportFollower, ReportGuard, ReportTurn
from wallride.runtime.control.report.measures import mean_of_nearest_m, range_ahead_m
from wallride.runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.virtual.devices import BEAMS, STEP_RAD, ranges_between_walls


def wall_scan(distance_m, angle_rad=0.0, ahead_m=math.nan):
    """A single endless wall on the left, its heading turned by `angle_rad` against the car's."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges_m = distance_m / np.sin(BEARING_RAD - angle_rad)
    ranges_m[(ranges_m < 0) | (ranges_m > 30)] = np.nan
    front = np.abs(BEARING_RAD) < math.radians(3)
    if not math.isnan(ahead_m):
        ranges_m[front] = ahead_m
    return scan_of(ranges_m)


def mirrored(scan):
    return scan_of(scan.ranges_m[::-1].copy())


def follower(**changes):
    return ReportFollower(ReportFollowSettings(**changes))


def test_parallel_at_the_desired_distance_goes_straight():
    answer = follower().follow(wall_scan(1.0), None)
    assert answer.drive.steering_rad == pytest.approx(0, abs=1e-3)
    assert answer.error_m == pytest.approx(0, abs=1e-4)
    assert answer.drive.speed_mps == 1.0


@pytest.mark.parametrize("error_m", [-0.3, -0.1, 0.1, 0.3])
def test_steers_kp_times_error_towards_the_wall_when_too_far(error_m):
    answer = follower(kd=0.0).follow(wall_scan(1.0 + error_m), None)
    assert answer.drive.steering_rad == pytest.approx(1.5 * error_m, abs=2e-3)


@pytest.mark.parametrize("angle_rad", [-0.5, -0.2, 0.2, 0.5])
def test_steers_kd_times_the_angle_of_the_wall(angle_rad):
    answer = follower(kp=0.0).follow(wall_scan(1.0, angle_rad), None)
    assert answer.drive.steering_rad == pytest.approx(1.6 * angle_rad, abs=2e-3)
    assert answer.angle_rad == pytest.approx(angle_rad, abs=1e-3)


def test_no_steering_beyond_a_third_of_pi():
    steep, less = math.radians(62), math.radians(58)
    assert follower().follow(wall_scan(1.5, -steep), None).drive.steering_rad == 0
    assert follower().follow(wall_scan(1.5, -less), None).drive.steering_rad != 0


@pytest.mark.parametrize("distance_m", [0.7, 1.0, 1.4])
@pytest.mark.parametrize("angle_rad", [-0.3, 0.0, 0.3])
def test_the_right_side_is_the_left_side_in_a_mirror(distance_m, angle_rad):
    scan = wall_scan(distance_m, angle_rad, ahead_m=3.0)
    left = follower(side="left").follow(scan, None)
    right = follower(side="right").follow(mirrored(scan), None)
    assert right.drive.steering_rad == pytest.approx(-left.drive.steering_rad)
    assert right.angle_rad == pytest.approx(-left.angle_rad)
    assert right.distance_m == pytest.approx(left.distance_m)


def test_the_distance_is_the_mean_of_the_three_nearest():
    ranges_m = np.full(BEAMS, 3.0)
    left = int(BEAMS // 2 + math.radians(60) / STEP_RAD)
    ranges_m[left : left + 4] = [0.9, 0.5, 0.7, 2.0]
    assert follower().follow(scan_of(ranges_m), None).distance_m == pytest.approx(0.7)
    assert mean_of_nearest_m(np.array([4.0, 1.0])) == 2.5


def test_nonsense_under_20_cm_is_dropped_and_the_first_sense_is_not():
    ranges_m = np.full(BEAMS, 1.0)
    ranges_m[np.abs(BEARING_RAD) < 0.1] = 5.0  # no corner ahead
    ranges_m[::7] = 0.2
    assert follower().follow(scan_of(ranges_m), None).distance_m == pytest.approx(1.0)
    ranges_m[::7] = 0.21
    assert follower().follow(scan_of(ranges_m), None).distance_m == pytest.approx(0.21)


def test_only_the_side_sector_counts():
    ranges_m = np.full(BEAMS, np.nan)
    ranges_m[0.6 * math.pi + 0.01 < BEARING_RAD] = 0.5
    ranges_m[BEARING_RAD < 0.0] = 0.5
    answer = follower().follow(scan_of(ranges_m), None)
    assert answer.drive is None
    assert answer.reason == "no wall in the side sector"


@pytest.mark.parametrize(("ahead_m", "distance_m"), [(2.0, 1.0), (1.6, 0.8), (1.0, 0.5), (2.01, 1.3)])
def test_the_corner_rule_halves_the_beam_ahead(ahead_m, distance_m):
    answer = follower().follow(wall_scan(1.3, ahead_m=ahead_m), None)
    assert answer.distance_m == pytest.approx(distance_m, abs=2e-3)


def test_without_the_corner_rule_what_is_ahead_does_not_count():
    answer = follower(corner_ahead_m=0.0).follow(wall_scan(1.3, ahead_m=1.0), None)
    assert answer.distance_m == pytest.approx(1.3, abs=2e-3)
    assert answer.reason == "wall"


@pytest.mark.parametrize(("side", "away"), [("left", -0.34), ("right", 0.34)])
@pytest.mark.parametrize(("ahead_m", "turns"), [(1.49, True), (0.95, True), (1.51, False), (math.nan, False)])
def test_the_second_safety_rule_turns_fully_away_from_the_wall(side, away, ahead_m, turns):
    scan = wall_scan(1.0, ahead_m=ahead_m)
    scan = scan if side == "left" else mirrored(scan)
    plain = follower(side=side)
    answer = ReportTurn(plain, ReportGuard(CarSettings()), side).follow(scan, None)
    if turns:
        assert answer.drive is not None
        assert answer.drive.steering_rad == away
        assert answer.drive.speed_mps == 1.0
        assert answer.reason == "obstacle ahead: turning away"
    else:
        assert is_same(answer, plain.follow(scan, None))


def test_the_second_safety_rule_can_be_switched_off():
    guard = ReportGuard(CarSettings(), ReportSafetySettings(turn_below_m=0.0))
    scan = wall_scan(1.0, ahead_m=1.2)
    assert is_same(ReportTurn(follower(), guard, "left").follow(scan, None), follower().follow(scan, None))
    guard.tune(ReportSafetySettings(turn_below_m=1.3))
    assert ReportTurn(follower(), guard, "left").follow(scan, None).drive == Drive(1.0, -0.34)


def test_who_sees_no_wall_is_not_turned():
    ranges_m = np.full(BEAMS, np.nan)
    ranges_m[BEAMS // 2 - 2 : BEAMS // 2 + 3] = 1.2
    answer = ReportTurn(follower(), ReportGuard(CarSettings()), "left").follow(scan_of(ranges_m), None)
    assert answer.drive is None


def test_safety_stops_at_the_turning_radius():
    guard = ReportGuard(CarSettings())
    assert guard.stop_below_m == pytest.approx(0.9329, abs=1e-4)
    assert guard.look(wall_scan(1.0, ahead_m=0.932), None).forward_mps == 0
    assert guard.look(wall_scan(1.0, ahead_m=0.934), None).forward_mps == math.inf
    assert guard.look(wall_scan(1.0, ahead_m=0.5), None).reverse_mps == math.inf


def test_safety_knows_the_cars_own_geometry():
    guard = ReportGuard(CarSettings(wheelbase_m=0.25, max_steering_rad=0.4))
    assert guard.stop_below_m == pytest.approx(0.25 / math.tan(0.4))


def test_nothing_ahead_is_infinitely_far():
    assert range_ahead_m(scan_of(ranges_between_walls(1.0, 1.0))) == math.inf


def test_dust_ahead_does_not_stop_the_car():
    ranges_m = ranges_between_walls(1.0, 1.0, ahead_m=5.0)
    ranges_m[BEAMS // 2 - 1 : BEAMS // 2 + 2] = 0.05
    assert ReportGuard(CarSettings()).look(scan_of(ranges_m), None).forward_mps == math.inf


@pytest.mark.parametrize(("speed_mps", "ahead_m", "distance_m"), [(2.0, 2.5, 1.25), (2.0, 2.7, 1.3), (1.0, 1.2, 1.2)])
def test_the_corner_rule_of_lab_2_reckons_with_the_speed(speed_mps, ahead_m, distance_m):
    """Range ahead up to nearest x velocity: ahead / velocity counts."""
    law = follower(corner_rule="lab2", speed_mps=speed_mps)
    assert law.follow(wall_scan(1.3, ahead_m=ahead_m), None).distance_m == pytest.approx(distance_m, abs=2e-3)


def test_the_corner_rule_of_lab_2_is_silent_at_a_standstill():
    assert follower(corner_rule="lab2", speed_mps=0.0).follow(wall_scan(1.3, ahead_m=0.5), None).reason == "wall"


@pytest.mark.parametrize("angle_rad", [-0.4, 0.0, 0.3])
def test_line_and_intercept_are_distances_to_the_same_wall(angle_rad):
    scan = wall_scan(1.2, angle_rad)
    line = follower(distance="line").follow(scan, None)
    intercept = follower(distance="intercept").follow(scan, None)
    assert line.distance_m == pytest.approx(1.2, abs=2e-3)
    assert intercept.distance_m == pytest.approx(1.2 / math.cos(angle_rad), abs=4e-3)
    assert line.angle_rad == intercept.angle_rad


@pytest.mark.parametrize("side", ["left", "right"])
def test_by_the_letter_one_beam_is_ahead_and_the_sector_begins_there(side):
    ranges_m = np.full(BEAMS, 5.0)
    ranges_m[BEAMS // 2 - 1 : BEAMS // 2 + 2] = np.nan
    letter = BEAMS // 2 + (1 if side == "left" else 0)
    ranges_m[letter] = 1.8
    near = np.radians(10.0 if side == "left" else -10.0)
    ranges_m[np.abs(BEARING_RAD - near) < 0.01] = 0.7
    assert follower(side=side, by_the_letter=True).follow(scan_of(ranges_m), None).distance_m == pytest.approx(0.9)
    ranges_m[letter] = np.nan
    assert follower(side=side, by_the_letter=True).follow(scan_of(ranges_m), None).distance_m == pytest.approx(0.7)
    assert follower(side=side).follow(scan_of(ranges_m), None).distance_m == pytest.approx(5.0)


def test_by_the_letter_the_second_safety_rule_is_a_stop():
    """Its message does not set the speed; and the middle beam is not filtered."""
    guard = ReportGuard(CarSettings(), ReportSafetySettings(by_the_letter=True))
    answer = ReportTurn(follower(), guard, "left").follow(wall_scan(1.0, ahead_m=1.2), None)
    assert answer.drive == Drive(0.0, -0.34)
    dusty = ranges_between_walls(1.0, 1.0, ahead_m=5.0)
    dusty[BEAMS // 2] = 0.05
    assert guard.look(scan_of(dusty), None).forward_mps == 0
    assert ReportGuard(CarSettings()).look(scan_of(dusty), None).forward_mps == math.inf


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("ahead_m", [math.nan, 1.7])
@pytest.mark.parametrize("angle_rad", [-1.2, -0.3, 0.2])
def test_the_law_that_wallride_new_writes_is_the_reports(side, ahead_m, angle_rad):
    scan = wall_scan(1.2, angle_rad, ahead_m)
    scan = scan if side == "left" else mirrored(scan)
    seen = LawScan(0.0, np.asarray(BEARING_RAD, np.float64), scan.ranges_m.astype(np.float64), 0.27)
    own = PdFollower(PdSettings(), CarSettings()).follow(seen, LawState(1, 0, 0, 0, 0, side, 1.0, 2.0))
    theirs = follower(side=side, speed_mps=2.0).follow(scan, None)
    assert (own.speed_mps, own.reason) == (theirs.drive.speed_mps, theirs.reason)
    assert own.steering_rad == pytest.approx(theirs.drive.steering_rad, abs=1e-6)
    assert own.distance_m == pytest.approx(theirs.distance_m, abs=1e-6)
