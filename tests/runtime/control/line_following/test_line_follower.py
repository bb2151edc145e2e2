"""The follower `line`: the line where the pose is known, else the wall, and it says so."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import round_the_block
from tests.runtime.control.localization.rooms import report
from tests.runtime.control.localization.test_localizer import CORNER
from wallride.drivers.api import Drive
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.line_following import line_follower
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.lap_correction import LapCorrection
from wallride.runtime.control.line_following.line_follower import LineFollower
from wallride.runtime.control.line_following.line_settings import LineFollowSettings
from wallride.runtime.control.line_following.observed_slip import ObservedSlip
from wallride.runtime.control.localization.localizer import Localizer, PoseEstimate, Whereabouts
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.safety.promise_record import KEPT_S, KEPT_WAY_M
from wallride.runtime.control.safety.swept import assumed
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.tyres import Moving
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings, ServoCar

CAR = CarSettings(max_speed_mps=6.0)
START = (2.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def believed_at_once(monkeypatch):
    monkeypatch.setattr(line_follower, "BELIEVED_S", 0.0)
    monkeypatch.setattr(line_follower, "BELIEVED_M", 0.0)


def follower(field, line=None, start=START, car=CAR, **settings):
    course = field and RaceCourse("lab", field, Localizer(field, car, start), line or round_the_block())
    chosen = LineFollowSettings(desired_distance_m=0.9, side="right", **settings)
    return LineFollower(chosen, car, Perception(car, assumed(SweptSettings())), course)


def answers(one, room, pose, *, scans=6, begin=0, speed_mps=0.0, **more):
    """Return the guidance at each of some scans of a car that is held at a place."""
    found = []
    for k in range(begin, begin + scans):
        scan = room.scan(pose, stamp_s=0.025 * k, noise_m=0.01, seed=k, number=k, **more)
        found.append(one.follow(scan, report(0.025 * k, speed_mps=speed_mps)))
    return found


def test_on_the_line_the_wall_is_followed_after_the_answer_and_at_every_scan(room, field, monkeypatch):
    one, followed = follower(field), []
    follow = one._wall.follow

    def noted(scan, motor):
        followed.append(scan.sequence)
        return follow(scan, motor)

    monkeypatch.setattr(one._wall, "follow", noted)
    sixth = answers(one, room, (2.0, 0.0, 0.0))[-1]
    assert (sixth.reason, followed) == (line_follower.DRIVES, [0, 1, 2, 3, 4])
    one._perception.learn()
    assert followed == [0, 1, 2, 3, 4, 5]
    answers(one, room, (2.0, 0.0, 0.0), begin=6, scans=1)
    assert followed == [0, 1, 2, 3, 4, 5]
    one.tune(one._settings)
    assert followed == [0, 1, 2, 3, 4, 5, 6]


def test_on_the_line_it_drives_the_line(room, field):
    one = follower(field, first_lap_share=1.0)
    last = answers(one, room, (2.0, 0.05, 0.0), speed_mps=3.0)[-1]
    assert last.reason == line_follower.DRIVES
    assert last.drive is not None
    assert last.drive.speed_mps == pytest.approx(3.0, abs=0.05)
    assert last.error_m == pytest.approx(0.05, abs=0.03)
    assert abs(last.angle_rad) < 0.02
    assert one.path_m is not None
    assert one.path_m[0, -1] > 3.0


@pytest.mark.parametrize(("yaw_rad", "end_rad"), [(0.3, -0.1), (-0.3, 0.2)])
def test_it_steers_no_more_than_the_servo_does(room, field, yaw_rad, end_rad):
    car = ServoCar(max_speed_mps=6.0, servo_ends_rad=(-0.1, 0.2))
    last = answers(follower(field, car=car), room, (2.0, 0.05, yaw_rad))[-1]
    assert (last.reason, last.drive.steering_rad) == (line_follower.DRIVES, end_rad)


def test_it_aims_to_the_side_that_the_laps_have_taught(room, field, monkeypatch):
    steered_rad = []
    for aim_m in (0.0, -0.05):
        monkeypatch.setattr(LapCorrection, "aim_m", lambda *_, aim_m=aim_m: aim_m)
        one = follower(field, first_lap_share=1.0)
        drive = answers(one, room, (2.0, 0.0, 0.0), speed_mps=3.0)[-1].drive
        steered_rad.append(drive.steering_rad)
    assert steered_rad[1] < steered_rad[0] - 0.02, "to the right"


@pytest.mark.parametrize(("speed_mps", "counts"), [(2.9, True), (2.0, False)])
def test_the_error_of_a_car_slower_than_asked_teaches_nothing(room, field, monkeypatch, speed_mps, counts):
    taught = []
    monkeypatch.setattr(LapCorrection, "take", lambda _, *place: taught.append(place))
    one = follower(field, first_lap_share=1.0)
    answers(one, room, (2.0, 0.05, 0.0), speed_mps=speed_mps)
    assert bool(taught) is counts
    assert all(aside_m == pytest.approx(0.05, abs=0.03) for _, aside_m, _ in taught)


@pytest.mark.parametrize(
    ("told_rad", "turn_radps", "counts"), [(0.1, 1.0, True), (0.34, 1.0, False), (0.1, 2.6, False)]
)
def test_the_error_of_a_car_at_the_end_of_steering_or_grip_teaches_nothing(field, told_rad, turn_radps, counts):
    one, line = follower(field, first_lap_share=1.0), round_the_block()
    one._told.rad = told_rad
    assert one._teaches(Moving(2.0 + 0j, 0.0, 3.0, turn_radps), line, line.nearest(2.0)) is counts


@pytest.mark.parametrize(("turn_radps", "more_mps"), [(0.0, 0.35), (1.5, 0.28), (2.2, 0.14), (2.4, 0.03)])
def test_in_a_bend_it_asks_for_no_more_than_the_grip_that_is_left_gains(field, turn_radps, more_mps):
    """Where a lap ends in a bend, the share of the line's speed rises by a fifth at once."""
    one, line = follower(field, first_lap_share=1.0, floor_mu=0.8), round_the_block()
    asked_mps = one._by_grip_mps(Moving(2.0 + 0j, 0.0, 3.0, turn_radps), line.nearest(2.0), one._tyres())
    assert asked_mps == pytest.approx(3.0 + more_mps, abs=0.04)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("bend", "slower_mps"), [(0.0, 3.0), (0.7, 0.40), (1.0, 0.19)])
def test_in_a_bend_it_slows_down_by_no_more_than_the_grip_that_is_left(field, known, bend, slower_mps):
    """Also for a pose that is lost in it: the wall's 1 m/s would be obeyed at once, and the car spins."""
    one = follower(field, floor_mu=0.8)
    one._pose = PoseEstimate(0.0, Whereabouts.LOST)
    if known:
        one._pose = replace(one._pose, turn_radps=math.sin(bend) / math.sin(1.0) * 0.8 * GRAVITY_MPS2 / 4.0)
    one._told.rad = math.atan(0.8 * GRAVITY_MPS2 / 16.0 * one._car.wheelbase_m) * math.sin(bend) / math.sin(1.0)
    asked = Guidance(Drive(1.0, 0.2), math.nan, 0.0, 0.0, "along the wall")
    eased = one._eased(asked, report(0.0, speed_mps=4.0)).drive
    assert (eased.speed_mps, eased.steering_rad) == (pytest.approx(4.0 - slower_mps, abs=0.08), 0.2)
    stopped = replace(asked, drive=Drive(0.0, 0.2))
    assert one._eased(stopped, report(0.0, speed_mps=4.0)) is stopped
    assert one._eased(asked, report(0.0, speed_mps=0.9)) is asked


def test_a_turn_that_only_begins_does_not_point_the_promise_outward(field):
    """The tyres slip as in a steady bend only a while later: 0.3 rad at this turn, which no car comes back from."""
    one, line = follower(field, first_lap_share=1.0), round_the_block()
    one._joined, one._on, tyres = True, line.nearest(2.0), one._tyres()
    outward_rad = []
    for k in range(60):
        promise = one._promise(0.025 * k, 0.025, Moving(2.0 + 0j, 0.0, 5.5, 1.4), line, tyres, 1.0)
        outward_rad.append(-math.atan2(promise.path_m[1, 1], promise.path_m[0, 1]))
    assert outward_rad[0] < 0.06
    assert outward_rad[-1] == pytest.approx(tyres.rear_slip_rad(5.5 * 1.4), abs=0.1)
    assert outward_rad[-1] > 0.2


def test_on_the_line_it_promises_it_and_elsewhere_nothing(room, field):
    one = follower(field, first_lap_share=0.5)
    on_it = answers(one, room, (2.0, 0.05, 0.0), speed_mps=1.5)[-1]
    assert on_it.promise.path_m[:, 0].tolist() == [0.0, 0.0]
    assert on_it.promise.path_m[0, -1] > 2.0
    assert on_it.promise.path_m[1, -1] == pytest.approx(-0.05, abs=0.03)
    assert on_it.promise.speed_mps == pytest.approx(np.full(on_it.promise.speed_mps.shape, 1.5), abs=0.01)
    assert on_it.promise.stamp_s == 0.025 * 5
    beside = answers(follower(field), room, (2.0, -0.45, 0.0))[-1]
    assert (beside.reason, beside.promise) == (line_follower.JOINS, None)
    assert answers(follower(None), room, (2.0, 0.0, 0.0))[-1].promise is None


def test_the_first_lap_is_slower_and_the_speed_has_its_bound(room, field):
    slow = answers(follower(field, first_lap_share=0.5), room, (2.0, 0.0, 0.0), speed_mps=1.5)[-1]
    assert slow.drive.speed_mps == pytest.approx(1.5, abs=0.05)
    one = follower(field, first_lap_share=1.0, speed_mps=1.7)
    bound = answers(one, room, (2.0, 0.0, 0.0), speed_mps=1.7)[-1]
    assert bound.drive.speed_mps == pytest.approx(1.7 / one._course.localizer.scale), "the true speed"


@pytest.mark.parametrize(("slippery", "share"), [(1.0, 1.0), (1.05, 1.0), (1.2, 0.8**0.5), (2.0, 0.8**0.5)])
def test_on_a_floor_with_less_grip_than_planned_for_the_line_is_driven_slower(
    room, field, monkeypatch, slippery, share
):
    line = round_the_block()
    mu = slippery * line.aside_mps2 / GRAVITY_MPS2  # all that the line needs is there
    one = follower(field, line, first_lap_share=1.0, floor_mu=mu)
    monkeypatch.setattr(ObservedSlip, "take", lambda _, car, since_s, assumed, slip: slippery * assumed.slip_s2pm)
    last = answers(one, room, (2.0, 0.0, 0.0), speed_mps=3.0)[-1]
    assert last.drive.speed_mps == pytest.approx(3.0 * share, abs=0.05)
    assert one.figures["speed_share"] == pytest.approx(share, abs=0.01)


def test_on_the_line_it_is_slow_until_safety_believes_its_path(room, field, monkeypatch):
    monkeypatch.undo()
    one = follower(field, first_lap_share=1.0)
    drives = [answer.drive.speed_mps for answer in answers(one, room, (2.0, 0.0, 0.0), scans=45, speed_mps=1.2)]
    fast = next(scan for scan, speed_mps in enumerate(drives) if speed_mps > 1.5)
    assert fast * 0.025 * 1.2 >= KEPT_WAY_M
    assert fast * 0.025 >= KEPT_S
    assert drives[fast - 1] == pytest.approx(1.2, abs=0.05)


def test_beside_the_line_it_joins_slowly(room, field):
    last = answers(follower(field), room, (2.0, -0.45, 0.0))[-1]
    assert last.reason == line_follower.JOINS
    assert last.drive.speed_mps == pytest.approx(1.2, abs=0.05)
    assert last.drive.steering_rad > 0.1


@pytest.mark.parametrize("course", [False, True])
def test_without_map_or_line_it_follows_the_wall(room, field, course):
    one = follower(field if course else None)
    if course:
        one._course = replace(one._course, line=None)
    last = answers(one, room, (2.0, 0.0, 0.0))[-1]
    assert last.reason == line_follower.NO_LINE
    assert 0.0 < last.drive.speed_mps <= 1.0
    assert one.path_m is not None


def test_against_the_line_it_follows_the_wall(room, field):
    one = follower(field, start=(2.0, 0.0, math.pi))
    last = answers(one, room, (2.0, 0.0, math.pi))[-1]
    assert last.reason == line_follower.WRONG_WAY
    assert abs(last.toward_rad) == pytest.approx(math.pi, abs=0.05)
    assert math.isnan(answers(follower(field), room, START)[-1].toward_rad)


def test_a_way_through_the_block_is_not_taken(room, field):
    line = replace(round_the_block(), places_m=round_the_block().places_m + 3.0j)
    last = answers(follower(field, line=line, start=(4.0, -0.4, 0.0)), room, (4.0, -0.4, 0.0))[-1]
    assert last.reason == line_follower.BLOCKED


@pytest.mark.parametrize(("without_pose", "drives"), [("wall", True), ("stop", False)])
def test_a_lost_car_follows_the_wall_or_stops(room, field, without_pose, drives):
    one = follower(field, without_pose=without_pose, first_lap_share=1.0)
    before = answers(one, room, (2.0, 0.0, 0.0), speed_mps=3.0)[-1]
    assert before.drive.speed_mps > 2.5
    lost = answers(one, room, CORNER, scans=8, begin=6, speed_mps=3.0)
    after = next(one for one in lost if one.reason not in {line_follower.DRIVES, line_follower.JOINS})
    assert after.reason == (line_follower.UNKNOWN if drives else line_follower.STOPPED)
    assert (after.drive is not None) is drives
    assert after.drive is None or after.drive.speed_mps <= 1.0


def test_a_car_that_is_held_back_drives_the_next_laps_slower(room, field):
    one = follower(field, first_lap_share=0.6)
    one._build_up._reached = 1.0
    answers(one, room, (2.0, 0.0, 0.0), scans=100, speed_mps=3.0)
    assert one.figures["speed_share"] == 1.0
    answers(one, room, (2.0, 0.0, 0.0), scans=300, begin=100)
    assert one.figures["speed_share"] == pytest.approx(0.8), "it asks for 3 m/s and stands, once"


def test_a_car_that_is_held_back_beside_the_line_drives_the_next_laps_as_fast(room):
    one = follower(None)
    one._build_up._reached = 1.0
    answers(one, room, (2.0, 0.0, 0.0), scans=100, speed_mps=1.0)
    last = answers(one, room, (2.0, 0.0, 0.0), scans=300, begin=100)[-1]
    assert last.reason == line_follower.NO_LINE
    assert last.drive.speed_mps > 0.6
    assert one.figures["speed_share"] == 1.0


def test_settings_change_while_it_drives(room, field):
    one = follower(field, first_lap_share=1.0)
    answers(one, room, (2.0, 0.0, 0.0))
    one.tune(LineFollowSettings(desired_distance_m=0.9, side="right", speed_mps=1.5, first_lap_share=1.0))
    last = answers(one, room, (2.0, 0.0, 0.0), begin=6, scans=1)[-1]
    assert (last.reason, last.drive.speed_mps) == (line_follower.DRIVES, 1.5)


def test_the_same_scans_give_the_same_answers_to_the_bit(room, field):
    first, second = (answers(follower(field), room, (2.0, 0.1, 0.02), scans=20) for _ in range(2))
    assert [(one.drive, one.error_m, one.reason) for one in first] == [
        (one.drive, one.error_m, one.reason) for one in second
    ]
