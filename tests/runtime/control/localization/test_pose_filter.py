"""One scan laid over the map: it pulls the pose where it tells something, and nowhere else."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.localization.rooms import BEAMS, LIDAR_M, among_people, corridor, ring
from wallride.runtime.control.localization.line_field import field_of_cells
from wallride.runtime.control.localization.pose_filter import PoseFilter, WheelStep, inverse
from wallride.runtime.control.localization.scan_on_lines import WEAK_SHARE
from wallride.runtime.control.localization.scan_points import AxleMotion, scan_points

STILL = AxleMotion(0.0, 0.0, 0.0)
WHEELBASE_M = 0.33


@pytest.fixture(scope="module")
def room():
    return ring()


@pytest.fixture(scope="module")
def long_one():
    room = corridor()
    return room, field_of_cells(room.cells)


def points(room, pose, **more):
    return scan_points(room.scan(pose, noise_m=0.01, **more), complex(LIDAR_M), STILL)


def placed(field, pose, off=(0.0, 0.0, 0.0), std_m=0.05, std_rad=0.03):
    filter_ = PoseFilter(field, WHEELBASE_M)
    x_m, y_m, yaw_rad = (at + by for at, by in zip(pose, off, strict=True))
    filter_.place(x_m, y_m, yaw_rad, std_m, std_rad)
    return filter_


@pytest.mark.parametrize("pose", [(9.6, 0.2, 0.4), (-0.2, 3.0, -1.5), (10.1, 5.6, 3.0)])
def test_a_scan_takes_a_pose_to_the_true_one(room, field, pose):
    filter_ = placed(field, pose, (0.06, -0.05, 0.04))
    fit = filter_.correct(points(room, pose))
    assert filter_.state[:3] == pytest.approx(pose, abs=0.01)
    assert fit.share > 0.95
    assert math.sqrt(filter_.covariance[0, 0]) < 0.02


def test_a_pose_farther_off_than_its_doubt_is_taken_there_by_some_scans(room, field):
    """The steps of one scan do not settle it."""
    pose = (9.6, 0.2, 0.4)
    filter_ = placed(field, pose, (0.3, -0.3, 0.25), std_rad=0.05)
    filter_.correct(points(room, pose))
    assert abs(filter_.state[0] - pose[0]) > 0.02
    for number in range(1, 6):
        filter_.correct(points(room, pose, seed=number))
    assert filter_.state[:3] == pytest.approx(pose, abs=0.01)


def test_people_over_half_of_the_view_do_not_move_the_pose(room, field):
    pose = (9.6, 0.2, 0.4)
    people = among_people(room.scan(pose, noise_m=0.01), 0.7)
    filter_ = placed(field, pose, (0.03, -0.03, 0.02))
    fit = filter_.correct(scan_points(people, complex(LIDAR_M), STILL))
    assert filter_.state[:3] == pytest.approx(pose, abs=0.02)
    assert 0.5 < fit.share < 0.9


def test_a_steering_that_is_trimmed_wrongly_does_not_lean_the_turn(room, field):
    filter_, turns = placed(field, (1.0, 0.0, 0.0)), []
    for step in range(1, 91):
        filter_.predict(WheelStep(0.025, 0.075, 3.0, -0.06))
        filter_.correct(points(room, (1.0 + 0.075 * step, 0.0, 0.0)))
        turns.append(float(filter_.state[3]))
    assert np.mean(turns[60:]) == pytest.approx(0.0, abs=0.03)


def test_a_corridor_tells_nothing_along_itself_and_the_doubt_grows_with_the_way(long_one):
    room, field = long_one
    pose = (10.0, 0.1, 0.02)
    filter_ = placed(field, pose, (0.08, 0.04, 0.02))
    fit = filter_.correct(points(room, pose))
    assert fit.determined < WEAK_SHARE
    assert filter_.state[1:3] == pytest.approx(pose[1:], abs=0.01)
    assert filter_.state[0] == pytest.approx(pose[0] + 0.08, abs=0.01), "the wheels alone tell the way along it"
    doubts = []
    for _ in range(40):
        filter_.predict(WheelStep(0.025, 0.1, 4.0, 0.0))
        filter_.correct(points(room, (float(filter_.state[0]), 0.1, 0.02)))
        doubts.append(math.sqrt(filter_.covariance[0, 0]))
    assert doubts[-1] > 0.07
    assert all(np.diff(doubts) > 0.0)


def test_the_end_of_a_corridor_corrects_what_the_wheels_got_wrong(long_one):
    """0.35 m off: a narrow kernel would take the end wall for people and leave it out."""
    room, field = long_one
    pose = (51.0, 0.0, 0.0)
    filter_ = placed(field, pose, (-0.35, 0.0, 0.0), std_m=0.3)
    for _ in range(3):
        filter_.correct(points(room, pose))
    assert filter_.state[0] == pytest.approx(pose[0], abs=0.02)


def test_a_car_ahead_does_not_take_the_pose_with_it_where_the_way_is_in_doubt(long_one):
    """It drives 1.2 m before the end of the corridor: a wall that is nearer than the doubt, to a wide kernel."""
    room, field = long_one
    ahead = room.scan((53.2, 0.0, 0.0), noise_m=0.01)
    ranges_m = ahead.ranges_m.copy()
    ranges_m[BEAMS // 2 - 60 : BEAMS // 2 + 61] = 0.9
    scan = replace(ahead, ranges_m=ranges_m)
    filter_ = placed(field, (53.2, 0.0, 0.0), (0.1, 0.0, 0.0), std_m=0.4)
    for _ in range(3):
        filter_.correct(scan_points(scan, complex(LIDAR_M), STILL))
    assert filter_.state[0] == pytest.approx(53.2, abs=0.03)


def test_the_scale_of_the_wheels_is_learnt_from_the_corrections(room, field):
    filter_ = placed(field, (0.0, 0.0, 0.0), std_m=0.01)
    for number in range(1, 60):
        pose = (0.1 * number, 0.0, 0.0)
        filter_.predict(WheelStep(0.05, 0.105, 2.1, 0.0))
        filter_.correct(points(room, pose, seed=number))
    assert filter_.scale == pytest.approx(1 / 1.05, abs=0.01)
    assert filter_.state[:3] == pytest.approx(pose, abs=0.03)


def test_a_turn_that_the_steering_does_not_tell_is_followed(room, field):
    """Tyres and a wrong trim: the car turns by 1 rad/s at 1 m/s with its wheels straight."""
    filter_ = placed(field, (9.0, -0.3, 0.0))
    for number in range(1, 41):
        yaw_rad = 0.025 * number
        pose = (9.0 + math.sin(yaw_rad), 0.7 - math.cos(yaw_rad), yaw_rad)
        filter_.predict(WheelStep(0.025, 0.025, 1.0, 0.0))
        filter_.correct(points(room, pose, seed=number))
    assert filter_.state[:3] == pytest.approx(pose, abs=0.02)
    assert filter_.state[3] > 0.6


def test_both_halves_of_the_covariance_stay_equal(room, field):
    """Their difference by rounding grew until a variance was negative: after 6.5 minutes the pose was an error."""
    filter_ = placed(field, (0.0, 0.0, 0.0), std_m=0.01)
    filter_.covariance[0, 1] += 1e-6
    for number in range(1, 30):
        filter_.predict(WheelStep(0.05, 0.1, 2.0, 0.01))
        filter_.correct(points(room, (0.1 * number, 0.0, 0.0), seed=number))
        assert (filter_.covariance == filter_.covariance.T).all()
        assert np.linalg.eigvalsh(filter_.covariance).min() > 0.0


def test_a_scan_without_beams_leaves_the_prediction(room, field):
    filter_ = placed(field, (9.6, 0.2, 0.4))
    before = filter_.state.copy()
    fit = filter_.correct(points(room, (9.6, 0.2, 0.4), keep=np.zeros(BEAMS, bool)))
    assert filter_.state == pytest.approx(before)
    assert math.isnan(fit.share)


@pytest.mark.parametrize("std", [(0.3, 0.3, 0.05), (2.0, 0.003, 0.002), (1e-3, 0.5, 0.1)])
def test_a_covariance_is_inverted(std):
    turned = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.1], [0.0, -0.1, 1.0]])
    covariance = turned @ np.diag(np.square(std)) @ turned.T
    inverted = np.reshape(inverse(tuple(covariance.ravel().tolist())), (3, 3))
    assert inverted @ covariance == pytest.approx(np.eye(3), abs=1e-6)
