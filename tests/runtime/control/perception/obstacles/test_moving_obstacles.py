"""Who walks is expected where he is going; what only comes into view is not taken for a walker."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, CAR, SCAN_S, see
from wallride.runtime.control.perception.geometry import NOWHERE
from wallride.runtime.control.perception.motion.own_motion import DrivenPlace, OwnMotion
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.perception.obstacles.moving_obstacles import (
    CARRIED_S,
    MAX_THINGS,
    SEEN_SCANS,
    WITHIN_M,
    MovingObstacles,
    find_small_clusters,
)
from wallride.runtime.control.perception.odometry import OdometryState

NO_PLACE = DrivenPlace(0.0, 0j, 1 + 0j, 0.0, 0.0)


def circle(x_m, y_m, radius_m=0.2):
    """Ranges to a leg or a person in base_link before a wall 9 m away."""
    dx, dy = x_m - CAR.lidar_x_m, y_m
    along = np.cos(BEARING_RAD) * dx + np.sin(BEARING_RAD) * dy
    aside = np.cos(BEARING_RAD) * dy - np.sin(BEARING_RAD) * dx
    with np.errstate(invalid="ignore"):
        near = along - np.sqrt(radius_m**2 - aside**2)
    return np.where((np.abs(aside) < radius_m) & (along > 0), near, 9.0)


def watch(place, *, pose=lambda _: OdometryState(), scans=24, radius_m=0.2, noise_m=0.02):
    """Return the walkers' points at the end; place and pose are functions of time."""
    movers, rng, points = MovingObstacles(), np.random.default_rng(3), NOWHERE
    for step in range(scans):
        at, now_s = pose(step * SCAN_S), step * SCAN_S
        x_m, y_m = place(now_s)
        cos, sin = math.cos(at.yaw_rad), math.sin(at.yaw_rad)
        dx, dy = x_m - at.x_m, y_m - at.y_m
        ranges_m = circle(cos * dx + sin * dy, cos * dy - sin * dx, radius_m) + rng.normal(0, noise_m, 1081)
        points = movers.update(see(ranges_m), at, now_s)
    return points


def predicted(place, scans, pillar=(2.0, 0.0)):
    """Return whether an object is predicted at each scan; place as in `watch`, or None: it is gone."""
    movers, found, pillar_m = MovingObstacles(), [], circle(pillar[0], pillar[1], 0.25)
    for step in range(scans):
        at = place(step * SCAN_S)
        ranges_m = np.minimum(pillar_m, circle(at[0], at[1])) if at else pillar_m
        found.append(bool(movers.update(see(ranges_m), OdometryState(), step * SCAN_S).size))
    return found


def test_a_person_behind_a_pillar_is_expected_for_a_moment():
    hidden = [step for step in range(80) if abs(1.5 - 1.4 * step * SCAN_S) < 0.2]
    found = predicted(lambda now_s: (3.2, max(0.0, 1.5 - 1.4 * now_s)), 80)  # stops there
    assert all(found[step] for step in hidden)
    assert not any(found[hidden[0] + round(CARRIED_S / SCAN_S) :])


def test_a_person_who_is_gone_from_where_the_lidar_sees_is_expected_no_more():
    found = predicted(lambda now_s: (3.2, 1.5 - 1.4 * now_s) if now_s < 0.5 else None, 30)
    assert found[19]
    assert not any(found[20:])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_person_who_crosses_is_expected_in_the_way(sign):
    points = watch(lambda now_s: (2.0, sign * (1.5 - 1.4 * now_s)))
    at_y = sign * (1.5 - 1.4 * 23 * SCAN_S)
    assert points.size > 0
    reached = (points.imag * sign).min()
    assert reached == pytest.approx(sign * at_y - 1.4 * 0.9 - 0.2, abs=0.25)
    assert points.real == pytest.approx(1.85, abs=0.25)


def rolling(speed_mps):
    """Return the poses of a car that rolls straight on."""
    return lambda now_s: OdometryState(speed_mps * now_s, 0.0, 0.0, speed_mps, 0.0)


@pytest.mark.parametrize(
    ("place", "told_mps", "more"),
    [
        (lambda _: (2.0, 0.8), 0.0, {}),
        (lambda now_s: (2.0 + 1.4 * now_s, 0.0), 0.0, {}),
        (lambda now_s: (5.8 - 0.4 * now_s, 0.0), 0.9 * 4.0, {"scans": 30}),
        (lambda _: (2.5, 0.8), 2.0, {"scans": 30, "radius_m": 0.05}),
    ],
    ids=["who stands", "who walks away", "by an odometry that is a tenth wrong", "what the car passes"],
)
def test_who_does_not_come_takes_no_room(place, told_mps, more):
    assert watch(place, pose=rolling(told_mps), **more).size == 0


def test_seven_scans_are_no_walk_however_fast():
    """Who runs at 2.9 m/s has long moved far and fast enough: it is the number of scans that counts."""

    def runs(now_s):
        return 2.5, 2.0 - 2.9 * now_s

    assert watch(runs, scans=SEEN_SCANS - 1, noise_m=0.0).size == 0
    assert watch(runs, scans=SEEN_SCANS, noise_m=0.0).size > 0
    assert SEEN_SCANS == 8


def test_who_runs_is_expected_and_what_flies_is_not():
    assert watch(lambda now_s: (3.0, 1.8 - 3.4 * now_s), scans=16).size > 0
    assert watch(lambda now_s: (3.0, 1.8 - 5.5 * now_s), scans=16).size == 0


@pytest.mark.parametrize("speed_mps", [0.0, 2.0, 4.0])
def test_a_person_who_comes_toward_the_car_is_expected_nearer(speed_mps):
    points = watch(lambda now_s: (5.5 - 1.5 * now_s, 0.1), pose=rolling(speed_mps), scans=20)
    now_x = 5.5 - (1.5 + speed_mps) * 19 * SCAN_S - 0.2
    assert points.size > 0
    assert points.real.min() == pytest.approx(now_x - 1.5 * 0.9, abs=0.3)
    assert abs(points.imag).max() < 0.4


def slide(walking_mps, scans=16):
    """Return the points at the end of a slide: the wheels stand, so does the odometry, and all comes nearer."""
    movers, points = MovingObstacles(), NOWHERE
    for step in range(20 + scans):
        now_s = step * SCAN_S
        true_m = 2.0 * min(now_s, 20 * SCAN_S) + 1.5 * max(0.0, now_s - 20 * SCAN_S)
        locked = step > 20
        told = OdometryState(2.0 * min(now_s, 20 * SCAN_S), 0.0, 0.0, 0.0 if locked else 2.0, 0.0)
        ranges_m = circle(4.5 - true_m, 1.6 - walking_mps * now_s)
        points = movers.update(see(ranges_m), told, now_s, sliding=locked)
    return points


def test_what_comes_nearer_while_the_wheels_are_locked_does_not_walk():
    assert slide(0.0).size == 0


def test_who_crosses_is_not_forgotten_while_the_wheels_are_locked():
    points = slide(1.4)
    assert points.size > 0
    assert points.imag.min() < 1.6 - 1.4 * 35 * SCAN_S - 1.0


def test_a_walker_is_seen_from_a_driving_car_too():
    points = watch(lambda now_s: (3.0, 1.5 - 1.4 * now_s), pose=rolling(1.0))
    assert points.size > 0
    assert points.imag.min() < -0.3


def test_while_the_car_turns_what_seems_to_cross_has_to_be_faster():
    straight = watch(lambda now_s: (2.5, 1.0 - 0.8 * now_s), pose=lambda _: OdometryState(0.0, 0.0, 0.0, 0.0, 0.0))
    turning = watch(lambda now_s: (2.5, 1.0 - 0.8 * now_s), pose=lambda _: OdometryState(0.0, 0.0, 0.0, 0.0, 1.0))
    assert straight.size > 0
    assert turning.size == 0


def test_a_hole_in_the_scans_ends_all_tracks():
    movers = MovingObstacles()
    for step in range(24):
        movers.update(see(circle(2.0, 1.5 - 0.035 * step)), OdometryState(), step * SCAN_S)
    assert movers.update(see(circle(2.0, 0.66)), OdometryState(), 24 * SCAN_S).size > 0
    assert movers.update(see(circle(2.0, 0.62)), OdometryState(), 24 * SCAN_S + 0.2).size == 0


def test_of_a_wall_that_comes_into_view_only_one_edge_moves():
    movers = MovingObstacles()
    for step in range(16):
        ranges_m = np.full(1081, 6.0)
        ranges_m[560 : 566 + 6 * step] = 1.5
        points = movers.update(see(ranges_m), OdometryState(), step * SCAN_S)
    assert points.size == 0


def by_turns(first, later):
    """Return the most walkers' points in any scan; six scans show some (beams, range), ten later ones others."""
    movers, most = MovingObstacles(), 0
    for step in range(16):
        ranges_m = np.full(1081, 6.0)
        for beams, range_m in first if step < 6 else later:
            ranges_m[beams] = range_m
        most = max(most, movers.update(see(ranges_m), OdometryState(), step * SCAN_S).size)
    return most


RIGHT, LEFT = slice(540, 546), slice(567, 573)
"""Two legs of a table, 2 m away, 0.23 m apart."""


def test_what_appears_beside_a_thing_that_is_still_there_has_not_walked_there():
    walked = by_turns([(RIGHT, 2.0)], [(LEFT, 2.0)])
    assert walked > 0, "by all the rest one thing went from here to there"
    still_there = slice(540, 543), 2.0  # three beams are enough to be there, and too few to be watched
    assert by_turns([(RIGHT, 2.0)], [still_there, (LEFT, 2.0)]) == 0
    assert by_turns([(RIGHT, 2.0)], [(slice(540, 541), 2.0), (LEFT, 2.0)]) == 0, "a thin leg is met by one beam"


def test_who_walks_comes_to_where_nothing_was():
    assert by_turns([(RIGHT, 2.0), (LEFT, math.nan)], [(RIGHT, math.nan), (LEFT, 2.0)]) > 0
    assert by_turns([(RIGHT, 2.0), (slice(570, 573), 2.0)], [(RIGHT, math.nan), (LEFT, 2.0)]) == 0


def test_what_was_hidden_before_has_walked_once_all_of_its_old_place_is_free():
    """As a box that crosses behind a bend's inner wall: the place to which it comes was in sight of no earlier scan."""
    inner_wall = slice(560, 580), 1.0
    assert by_turns([(RIGHT, 2.0), inner_wall], [(LEFT, 2.0)]) > 0
    assert by_turns([(RIGHT, 2.0), inner_wall], [(slice(543, 546), 2.0), (LEFT, 2.0)]) == 0
    assert by_turns([(RIGHT, 2.0), inner_wall], [inner_wall]) == 0


@pytest.mark.parametrize(
    ("speed_mps", "turn_radps", "crosses_mps", "seen"),
    [
        (3.0, 2.0, 0.0, False), (3.0, 2.0, 0.8, True), (3.0, 2.0, -0.8, True),
        (3.0, 1.0, 0.6, True), (6.0, 1.0, 0.6, False), (6.0, 1.0, 1.0, True),
    ],
)  # fmt: skip
def test_a_car_in_a_bend_tells_what_crosses_by_odometry_that_scans_correct(speed_mps, turn_radps, crosses_mps, seen):
    movers, rng, most = MovingObstacles(), np.random.default_rng(3), 0
    for step in range(24):
        now_s = step * SCAN_S
        yaw_rad = turn_radps * (now_s - 0.3)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        x_m, y_m = 4.0, crosses_mps * (now_s - 0.3)
        ranges_m = circle(cos * x_m + sin * y_m, cos * y_m - sin * x_m) + rng.normal(0.0, 0.01, 1081)
        moved = OwnMotion(NO_PLACE, NO_PLACE, sure=True, trim_rad=0.0, rolled=ScanPose(0j, yaw_rad))
        pose = OdometryState(0.0, 0.0, yaw_rad, speed_mps, turn_radps)
        most = max(most, movers.update(see(ranges_m), pose, now_s, lambda moved=moved: moved).size)
    assert (most > 0) == seen


def things(view):
    return find_small_clusters(view.solid, view.ranges_m, view.scan.angle_step_rad)


def test_small_things_stand_out_and_are_small():
    assert len(things(see(circle(2.0, 0.3)))) == 1
    assert things(see(circle(2.5, 0.3, radius_m=0.9))) == []
    assert things(see(circle(WITHIN_M + 1.0, 0.3))) == []
    before_a_near_wall = circle(2.0, 0.3)
    before_a_near_wall[600:] = 1.0
    assert len(things(see(before_a_near_wall))) == 0
    assert things(see(np.full(1081, math.nan))) == []


def test_what_is_seen_farther_away_than_anybody_runs_is_something_else():
    farther = slice(578, 584)
    assert by_turns([(RIGHT, 2.0), (farther, math.nan)], [(RIGHT, math.nan), (farther, 2.0)]) == 0


def test_what_has_crept_elsewhere_in_a_minute_does_not_walk():
    """Whatever moved an edge ten seconds ago says nothing about now."""
    movers, most = MovingObstacles(), 0
    for step in range(480):
        crept_m = 0.25 * min(1.0, step / 240)
        sways_m = 0.08 * math.sin(0.5 * step) if step > 440 else 0.0
        points = movers.update(see(circle(2.0, crept_m + sways_m)), OdometryState(), step * SCAN_S)
        most = max(most, points.size)
    assert most == 0


def test_of_many_objects_the_nearest_are_followed():
    """Each is compared with each track: a hall full of chairs must not cost the answer its time."""

    def hall(step, poles):
        ranges_m = circle(4.0, 1.6 - 0.035 * step)
        for place in range(poles):
            ranges_m[60 + 8 * place : 64 + 8 * place] = 1.0 + 0.05 * (place % 3)
        return ranges_m

    for poles, seen in ((MAX_THINGS - 5, True), (MAX_THINGS + 5, False)):
        movers = MovingObstacles()
        for step in range(16):
            points = movers.update(see(hall(step, poles)), OdometryState(), step * SCAN_S)
        assert bool(points.size) == seen
