"""What the lidar is known to see: covers are told from depth, by what was seen and by what moving shows."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, CAR, SCAN_S, scan_of
from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.perception.visibility.lidar_sectors import BLIND, DEPTH, MISSING, SEEN, UNPROVEN
from wallride.runtime.control.perception.visibility.unknown_regions import CRAWL_MPS
from wallride.runtime.control.perception.visibility.visibility import Visibility, crosses_within
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.sim.virtual.devices import BEAMS
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry

BEARING_DEG = np.linspace(-135.0, 135.0, BEAMS)
CORRIDOR = ((-5.0, 1.0, 55.0, 1.0), (-5.0, -1.0, 55.0, -1.0))
BLOCKED = (*CORRIDOR, (8.0, 1.0, 8.0, -1.0))
CORNER = ((-5.0, 1.0, 3.5, 1.0), (3.5, 1.0, 3.5, 20.0))
RANGE_M = 28.0


def ranges(walls_m, x_m=0.0, y_m=0.0, yaw_rad=0.0):
    """Return what a lidar sees of walls (x0, y0, x1, y1) from a pose of base_link; NaN beyond its range."""
    at = Pose(x_m, y_m, yaw_rad).ahead(CAR.lidar_x_m)
    ranges_m = SegmentGeometry(np.array(walls_m)).cast(at.x_m, at.y_m, BEARING_RAD + yaw_rad)
    return np.where(ranges_m < RANGE_M, ranges_m, np.nan)


def covered(ranges_m, from_deg, to_deg, reads_m=math.nan):
    return np.where((from_deg <= BEARING_DEG) & (to_deg >= BEARING_DEG), reads_m, ranges_m)


class Lidar:
    """A Visibility with eyes and a clock."""

    def __init__(self):
        self.eyes, self.visibility, self.now_s = ViewCache(CAR), Visibility(CAR), 10.0

    def look(self, ranges_m, x_m=0.0, yaw_rad=0.0, *, dirty=None):
        self.now_s += SCAN_S
        self.eyes.ignore(dirty)
        self.visibility.look(self.eyes.see(scan_of(ranges_m, self.now_s)), OdometryState(x_m, 0.0, yaw_rad))
        self.visibility.learn()
        return self.visibility

    def known(self, bearing_deg):
        sectors = self.visibility.sectors
        return self.visibility.states[round((math.radians(bearing_deg) - sectors.first_rad) / sectors.width_rad)]


@pytest.mark.parametrize(("from_deg", "to_deg", "reads_m", "there"), [
    (-1.5, 1.5, 0.1, True), (-1.0, 1.0, 0.1, False), (50.0, 56.0, 0.1, True), (110.0, 130.0, 0.1, False),
    (-1.5, 1.5, 0.3, False),
])  # fmt: skip
def test_three_degrees_of_returns_from_within_the_outline_are_something_on_the_lidar(from_deg, to_deg, reads_m, there):
    assert Lidar().look(covered(ranges(BLOCKED), from_deg, to_deg, reads_m)).on_lidar == there


def test_a_cover_at_the_edge_of_the_outline_is_on_the_lidar():
    reads_m = np.where(np.arange(1081) % 2, 0.145, 0.16)
    assert Lidar().look(covered(ranges(BLOCKED), -10, 10, reads_m)).on_lidar


def test_the_far_end_of_a_corridor_is_depth_from_the_first_scan_on():
    lidar = Lidar()
    assert not lidar.look(ranges(CORRIDOR)).suspicious
    assert lidar.known(0) == DEPTH


@pytest.mark.parametrize("half_deg", [30, 45, 60])
def test_silence_beside_walls_that_are_in_range_is_not(half_deg):
    seen = Lidar().look(covered(ranges(BLOCKED), -half_deg, half_deg))
    assert seen.suspicious
    unknown = seen.unknown()
    assert not unknown.blind
    # a wall across the way would show beside the silence, as far as the walls are seen there
    edge_m = CAR.lidar_x_m + 1.0 / math.tan(math.radians(half_deg))
    assert unknown.hard.real.min() == pytest.approx(edge_m, rel=0.12)


def test_with_nothing_seen_at_its_sides_the_unknown_begins_at_the_bumper():
    unknown = Lidar().look(np.full(1081, np.nan)).unknown()
    assert unknown.hard.real.max() == pytest.approx(CAR.front_m)


def test_a_silence_that_goes_along_while_walls_come_out_of_it_is_blind():
    lidar = Lidar()
    for step in range(20):
        x_m = 0.02 * step
        lidar.look(covered(ranges(BLOCKED, x_m), -45, 45), x_m)
        assert (lidar.known(0) == BLIND) == (x_m >= 0.25)


def test_the_end_of_a_wall_stays_where_it_is_and_proves_the_silence_beside_it():
    lidar, from_m = Lidar(), 0.26  # its bearing has just come into another sector
    for step in range(17):
        seen = lidar.look(ranges(CORNER, from_m + 0.02 * step), 0.02 * step)
        assert not np.any(seen.states == BLIND)
        assert seen.suspicious or 0.02 * step > 0.25
    assert not seen.suspicious


def test_the_new_end_of_a_wall_that_has_lost_a_piece_at_once_proves_nothing():
    lidar, from_m = Lidar(), 0.26
    lidar.look(ranges(((-5.0, 1.0, 4.6, 1.0),), from_m))
    for step in range(17):
        lidar.look(ranges(CORNER, from_m + 0.02 * step), 0.02 * step)
        assert lidar.known(15) in (UNPROVEN, MISSING)
        assert lidar.known(0) == UNPROVEN


@pytest.mark.parametrize("half_deg", [10, 30, 60, 90])
@pytest.mark.parametrize("turned_rad", [0.0, 0.025, -0.06])
def test_walls_that_are_missing_at_once_are_blindness_from_that_scan_on(half_deg, turned_rad):
    lidar = Lidar()
    for step in range(3):
        seen = lidar.look(ranges(BLOCKED, 0.1 * step, 0.0, turned_rad * step), 0.1 * step, turned_rad * step)
    assert not seen.suspicious
    seen = lidar.look(covered(ranges(BLOCKED, 0.3, 0.0, 3 * turned_rad), -half_deg, half_deg), 0.3, 3 * turned_rad)
    assert lidar.known(0) == BLIND
    assert seen.unknown().hard.size


def test_a_car_that_turns_away_from_a_wall_misses_nothing():
    lidar = Lidar()
    for step in range(15):
        yaw_rad = -0.1 * step
        seen = lidar.look(ranges(CORNER, 0.0, 0.0, yaw_rad), 0.0, yaw_rad)
        assert not np.any((seen.states == MISSING) | (seen.states == BLIND))


def test_ten_degrees_without_echo_are_no_blindness_but_what_was_there_is_remembered():
    lidar = Lidar()
    lidar.look(ranges(BLOCKED))
    seen = lidar.look(covered(ranges(BLOCKED), -5, 5))
    assert not np.any(seen.states == BLIND)
    unknown = seen.unknown()
    assert np.count_nonzero(np.abs(unknown.hard - (8.0 + 0.2j)) < 0.4) >= 3


def test_fifteen_degrees_are_blind_only_after_a_moment_and_thirty_at_once():
    for half_deg, at_once in ((10, False), (20, True)):
        lidar = Lidar()
        lidar.look(ranges(BLOCKED))
        blind = [lidar.look(covered(ranges(BLOCKED), -half_deg, half_deg)).unknown().blind for _ in range(4)]
        assert blind == [at_once, at_once, True, True]


def test_an_echo_ends_blindness():
    lidar = Lidar()
    lidar.look(ranges(BLOCKED))
    assert lidar.look(covered(ranges(BLOCKED), -60, 60)).suspicious
    assert not lidar.look(ranges(BLOCKED)).suspicious
    assert lidar.known(0) == SEEN


def test_wild_beams_prove_nothing():
    lidar, random = Lidar(), np.random.default_rng(3)
    lidar.look(ranges(BLOCKED))
    for _ in range(40):
        ranges_m = covered(ranges(BLOCKED), -60, 60)
        wild = random.random(1081) < 0.05
        lidar.look(np.where(wild, random.uniform(0.2, 10.0, 1081), ranges_m))
        assert lidar.known(0) == BLIND


def test_beams_that_are_known_to_be_dirty_see_nothing():
    lidar, dirty = Lidar(), np.abs(BEARING_DEG) < 20
    lidar.look(ranges(BLOCKED))
    lidar.look(covered(ranges(BLOCKED), -20, 20, 0.5), dirty=dirty)
    assert lidar.known(0) == BLIND


def test_a_gradual_horizon_stays_depth():
    lidar = Lidar()
    for half_deg in np.arange(0.0, 25.0, 2.5):
        seen = lidar.look(covered(ranges(CORRIDOR), -half_deg, 0.0))
    assert not np.any(seen.states == BLIND)


def grown(rate_degps, centre_deg=0.0, walls=CORRIDOR):
    """Drive down a corridor at 2 m/s while a cover grows; yields what is seen, and how far the cover reaches."""
    lidar = Lidar()
    for step in range(120):
        x_m, half_deg = 0.05 * step, max(0.0, rate_degps * 0.025 * (step - 20))
        yield lidar.look(covered(ranges(walls, x_m), centre_deg - half_deg, centre_deg + half_deg), x_m), half_deg


def test_a_cover_that_grows_slowly_from_the_corridors_far_end_is_not_depth():
    assert all(seen.suspicious for seen, half_deg in grown(20.0) if 22.0 < half_deg < 45.0)


def test_a_corridor_whose_far_end_stays_is_depth_all_the_way():
    assert not any(seen.suspicious for seen, _ in grown(0.0))


def test_after_a_hole_in_the_scans_nothing_is_expected():
    lidar = Lidar()
    lidar.look(ranges(BLOCKED))
    lidar.now_s += 1.0
    lidar.look(covered(ranges(BLOCKED), -5, 5))
    assert not np.any(lidar.visibility.states == MISSING)


def test_a_lidar_that_does_not_look_ahead_is_left_to_others():
    scan = Scan(1.0, 1.0, 1.0, 0.01, 0.02, 30.0, np.full(100, 2.0, np.float32), 0)
    seen = Visibility(CAR)
    seen.look(ViewCache(CAR).see(scan), OdometryState())
    assert not seen.suspicious


class Safety:
    """The whole safety, asked for one drive."""

    def __init__(self):
        self.guard, self.now_s, self.way_m = SweptGuard(SweptSettings(), CAR), 10.0, 0.0

    def limit(self, ranges_m, speed_mps, wanted_mps=2.0):
        self.now_s += SCAN_S
        self.way_m += SCAN_S * speed_mps
        motor = MotorState(self.now_s, speed_mps, self.way_m, 0.0)
        return judged(self.guard.look(scan_of(ranges_m, self.now_s), motor), wanted_mps, 0.0)


@pytest.mark.parametrize("reads_m", [0.03, 0.085, 0.12, 0.14])
@pytest.mark.parametrize("half_deg", [10, 45, 135])
def test_a_covered_front_is_a_stop_with_that_reason(reads_m, half_deg):
    verdict = Safety().limit(covered(ranges(CORRIDOR), -half_deg, half_deg, reads_m), 0.0)
    assert (verdict.forward_mps, verdict.reverse_mps) == (0.0, 0.0)
    assert "on the lidar" in verdict.reason


@pytest.mark.parametrize("half_deg", [20, 45, 90, 119])
def test_a_front_that_falls_silent_is_a_stop(half_deg):
    safety = Safety()
    assert safety.limit(ranges(BLOCKED), 2.0).forward_mps == math.inf
    verdict = safety.limit(covered(ranges(BLOCKED), -half_deg, half_deg), 2.0)
    assert (verdict.forward_mps, verdict.reason) == (0.0, "the lidar is blind ahead: uncover it")


def test_a_front_that_is_silent_from_the_start_is_approached_at_a_crawl():
    verdict = Safety().limit(covered(ranges(CORRIDOR), -45, 45), 0.0)
    assert (verdict.forward_mps, verdict.reason) == (CRAWL_MPS, "the lidar sees nothing ahead: crawling")
    assert Safety().limit(covered(ranges(CORRIDOR), -90, 90), 0.0).forward_mps == 0.0


def test_what_a_moment_ago_stood_in_a_small_gap_is_still_in_the_way():
    near = (*CORRIDOR, (0.8, -0.1, 0.8, 0.1))
    safety = Safety()
    for _ in range(2):
        safety.limit(ranges(near), 1.5)
    verdict = safety.limit(covered(ranges(near), -12, 12), 1.5)
    assert verdict.forward_mps < 1.2
    assert verdict.measure == pytest.approx(0.8 - CAR.front_m, abs=0.1)


@pytest.mark.parametrize(("right_deg", "left_deg"), [(-10, 0), (-12, 2), (-1, 11)])
def test_a_gap_that_falls_silent_beside_depth_is_crawled_at(right_deg, left_deg):
    safety = Safety()
    for _ in range(2):
        assert safety.limit(ranges(CORRIDOR), 3.0, 3.0).forward_mps == math.inf
    for _ in range(20):
        assert safety.limit(covered(ranges(CORRIDOR), right_deg, left_deg), 3.0, 3.0).forward_mps <= CRAWL_MPS
    safety.limit(ranges(CORRIDOR), 3.0, 3.0)
    assert safety.limit(ranges(CORRIDOR), 3.0, 3.0).forward_mps == math.inf


def test_a_doubted_gap_beside_the_way_is_not():
    safety = Safety()
    for _ in range(2):
        safety.limit(ranges(BLOCKED), 2.0)
    assert safety.limit(covered(ranges(BLOCKED), 40, 50), 2.0).forward_mps > CRAWL_MPS


def test_the_drive_down_an_open_corridor_is_not_limited():
    assert Safety().limit(ranges(CORRIDOR), 3.0, 4.0).forward_mps == math.inf


@pytest.mark.parametrize(("beams", "known"), [(2, BLIND), (4, SEEN)])
def test_three_beams_in_ten_that_agree_are_seeing(beams, known):
    lidar = Lidar()
    lidar.look(ranges(BLOCKED))
    lidar.look(covered(ranges(BLOCKED), -60, 60))
    ranges_m = covered(ranges(BLOCKED), -60, 60)
    ranges_m[539 : 539 + beams] = 3.0
    lidar.look(ranges_m)
    assert lidar.known(0) == known


@pytest.mark.parametrize(("way", "crosses"), [(1 + 0j, False), (0 - 1j, True), (0 + 1j, True)])
def test_a_wall_meets_the_beam_ahead_unless_it_is_parallel(way, crosses):
    assert crosses_within(2 + 1j, way, 0.0, 3.0) == crosses
    assert not crosses_within(2 + 1j, way, 0.0, 1.9)
