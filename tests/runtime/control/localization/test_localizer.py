"""Found, kept, lost, found again; and never guessed."""

import math

import numpy as np
import pytest

from tests.runtime.control.localization.rooms import BEAMS, LIDAR_M, Room, among_people, report, ring
from wallride.runtime.control.localization.line_field import field_of_cells
from wallride.runtime.control.localization.localizer import LOST_SCANS, Localizer, Whereabouts
from wallride.runtime.control.vehicle import CarSettings

CAR = CarSettings()
PERIOD_S = 0.025
START = (0.0, 0.0, 0.0)
ELSEWHERE = (10.0, 3.0, 1.5)
CORNER = (9.8, 5.9, -0.7)
WHOLE = 1_000_000


@pytest.fixture(scope="module")
def plain():
    room = ring()
    return room, field_of_cells(room.cells)


def stand(localizer, room, pose, *, scans=1, begin_s=0.0, **more):
    """Return the estimates of a car that stands somewhere."""
    found = []
    for number in range(scans):
        stamp_s = begin_s + number * PERIOD_S
        scan = room.scan(pose, stamp_s=stamp_s, noise_m=0.01, seed=number, number=number, **more)
        found.append(localizer.localize(scan, report(stamp_s)))
    return found


def at(estimate):
    return estimate.x_m, estimate.y_m, estimate.yaw_rad


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.3, -0.3, 0.2), (-0.4, 0.2, -0.3)])
def test_it_begins_where_the_laps_begin(room, field, off):
    pose = (-0.2 + off[0], 0.1 + off[1], off[2])
    last = stand(Localizer(field, CAR, START), room, pose, scans=5)[-1]
    assert last.whereabouts is Whereabouts.LOCATED
    assert at(last) == pytest.approx(pose, abs=0.02)
    assert last.share > 0.95


def test_the_answer_does_not_wait_for_a_search(room, field):
    localizer, scan, wheels = Localizer(field, CAR, START), room.scan(START), report(0.0)
    assert localizer.take(scan, wheels).whereabouts is Whereabouts.SEARCHING
    assert localizer.localize(scan, wheels).whereabouts is Whereabouts.LOCATED
    assert localizer.take(scan, wheels) is localizer.localize(scan, wheels)


def test_the_next_scan_searches_for_what_nothing_has_searched_for(room, field):
    localizer = Localizer(field, CAR, START)
    scans = [room.scan(START, stamp_s=number * PERIOD_S, number=number) for number in range(2)]
    found = [localizer.take(scan, report(scan.stamp_s)).whereabouts for scan in scans]
    assert found == [Whereabouts.SEARCHING, Whereabouts.LOCATED]


@pytest.mark.parametrize("pose", [ELSEWHERE, (10.0, 5.9, -1.5)])
def test_it_is_found_anywhere_part_by_part_while_it_stands(room, field, pose):
    localizer = Localizer(field, CAR, None)
    found = stand(localizer, room, pose, scans=200)
    assert found[0].whereabouts is Whereabouts.SEARCHING
    assert math.isnan(found[0].x_m)
    assert found[-1].whereabouts is Whereabouts.LOCATED
    assert at(found[-1]) == pytest.approx(pose, abs=0.03)


def test_a_start_at_another_place_is_searched_for(room, field):
    last = stand(Localizer(field, CAR, START, search_parts=WHOLE), room, ELSEWHERE, scans=4)[-1]
    assert at(last) == pytest.approx(ELSEWHERE, abs=0.03)


@pytest.mark.parametrize(
    "pose",
    [
        *((3.5, 0.0, 0.0), (4.5, -0.2, 0.1), (5.0, 6.0, math.pi), (7.5, 0.0, math.pi)),  # in a corridor as wide
        *((10.0, 0.0, math.pi / 2), (9.8, 0.3, 1.6)),  # in a corner
    ],
)
def test_another_place_that_looks_like_the_start_is_not_taken_for_it(room, field, pose):
    last = stand(Localizer(field, CAR, START, search_parts=WHOLE), room, pose, scans=4)[-1]
    places = [at(last)] if last.whereabouts is Whereabouts.LOCATED else last.alike
    away_m = [math.hypot(x_m - pose[0], y_m - pose[1]) for x_m, y_m, _ in places]
    assert min(away_m) < 0.1, "the true one, or it is among those that are said to be alike"
    assert min(math.hypot(x_m, y_m) for x_m, y_m, _ in places) > 1.0, "the start"


def test_a_start_among_people_is_compared_with_the_whole_map_and_taken(room, field):
    localizer = Localizer(field, CAR, START)
    found = []
    for number in range(300):
        scan = room.scan(START, stamp_s=number * PERIOD_S, noise_m=0.01, seed=number)
        found.append(localizer.localize(among_people(scan), report(scan.stamp_s)))
    assert found[0].whereabouts is Whereabouts.SEARCHING
    assert at(found[-1]) == pytest.approx(START, abs=0.03)


def test_a_doubted_start_is_followed_by_the_scans_while_the_whole_map_is_searched(room, field):
    """By the wheels alone, which report too much and turn unsteered, it would be 0.12 m and 0.09 rad off by then."""
    localizer = Localizer(field, CAR, START)
    located = None
    for number in range(45):
        stamp_s, way_m = number * PERIOD_S, 4.0 * number * PERIOD_S
        pose = (way_m, -0.02 * way_m**2, -0.04 * way_m)
        scan = room.scan(pose, stamp_s=stamp_s, noise_m=0.01, seed=number)
        last = localizer.localize(among_people(scan), report(stamp_s, 1.03 * way_m, speed_mps=4.12))
        if located is None and last.whereabouts is Whereabouts.LOCATED:
            located = number
            assert way_m > 1.0
            assert at(last) == pytest.approx(pose, abs=0.04)
    assert located is not None
    assert at(last) == pytest.approx(pose, abs=0.04)


def test_places_that_look_alike_are_said_and_not_guessed(plain):
    room, field = plain
    last = stand(Localizer(field, CAR, None, search_parts=WHOLE), room, (9.9, 0.2, 0.5), scans=4)[-1]
    assert last.whereabouts is Whereabouts.AMBIGUOUS
    assert math.isnan(last.x_m)
    assert len(last.alike) == 2
    (x0_m, y0_m, yaw0), (x1_m, y1_m, yaw1) = last.alike
    assert (x0_m + x1_m, y0_m + y1_m) == pytest.approx((10.0, 6.0), abs=0.1)
    assert abs(math.remainder(yaw0 - yaw1, math.tau)) == pytest.approx(math.pi, abs=0.05)


def test_where_the_laps_begin_decides_between_places_that_look_alike(plain):
    room, field = plain
    last = stand(Localizer(field, CAR, START), room, (-0.3, 0.2, -0.5), scans=4)[-1]
    assert at(last) == pytest.approx((-0.3, 0.2, -0.5), abs=0.03)


def carried(localizer, room, *, way_m=0.0, told=True, to=(-0.3, 0.2, -0.5)):
    """Return the estimate of a car that began elsewhere and was carried to a place; way_m: and drove before."""
    last = None
    for number in range(12):
        stamp_s, is_there = 0.5 * number, number > 3
        pose = to if is_there else (9.9, 0.2, 0.5)
        wheels = report(stamp_s, 40.0 + (way_m if is_there else 0.0)) if told else None
        last = localizer.localize(room.scan(pose, stamp_s=stamp_s, noise_m=0.01, seed=number, number=number), wheels)
    return last


def test_a_car_that_is_carried_to_the_start_is_found_there_until_it_drives(plain):
    room, field = plain
    start = carried(Localizer(field, CAR, START, search_parts=WHOLE), room)
    assert at(start) == pytest.approx((-0.3, 0.2, -0.5), abs=0.03)
    for changes in ({"way_m": 1.0}, {"way_m": -1.0}, {"told": False}, {"to": (10.3, 5.8, math.pi - 0.5)}):
        last = carried(Localizer(field, CAR, START, search_parts=WHOLE), room, **changes)
        is_start = "to" in changes  # the place that looks like it: what is told decides, as at first
        assert (last.whereabouts is Whereabouts.LOCATED) is is_start, changes
    never = carried(Localizer(field, CAR, START, search_parts=WHOLE), room, to=(9.9, 5.8, 2.0))
    assert never.whereabouts is Whereabouts.AMBIGUOUS


def test_on_a_line_against_the_lap_it_is_found_there_either_way_round(plain):
    room, field = plain
    for yaw_rad, turned in ((math.pi, True), (0.0, True), (0.0, False)):
        localizer = Localizer(field, CAR, START)
        localizer = localizer.either_way_round() if turned else localizer
        last = stand(localizer, room, (-0.3, 0.2, yaw_rad - 0.1), scans=4)[-1]
        off_rad = math.remainder(last.yaw_rad - yaw_rad, math.tau)
        assert (last.x_m, last.y_m, off_rad) == pytest.approx((-0.3, 0.2, -0.1), abs=0.03)
    other_way = Localizer(field, CAR, START, search_parts=WHOLE)
    assert stand(other_way, room, (-0.3, 0.2, math.pi), scans=4)[-1].whereabouts is Whereabouts.AMBIGUOUS


def test_a_start_that_fits_either_way_round_decides_nothing():
    room, pose = Room([(0.0, -1.0, 12.0, 1.0)]), (6.0 - LIDAR_M, 0.0, 0.0)
    localizer = Localizer(field_of_cells(room.cells), CAR, pose, search_parts=WHOLE).either_way_round()
    last = stand(localizer, room, pose, scans=4)[-1]
    assert last.whereabouts is Whereabouts.AMBIGUOUS


@pytest.mark.parametrize("pose", [CORNER, (-0.3, 2.0, 1.0), (9.5, -0.2, 0.4)])
def test_set_down_elsewhere_it_is_lost_at_once(room, field, pose):
    """Of the beams 1, 14 and 29 % fit there."""
    localizer = Localizer(field, CAR, START, search_parts=WHOLE)
    stand(localizer, room, START, scans=8)
    found = stand(localizer, room, pose, scans=LOST_SCANS, begin_s=8 * PERIOD_S)
    assert [one.whereabouts for one in found[:-1]] == [Whereabouts.LOCATED] * (LOST_SCANS - 1)
    assert found[-1].whereabouts is Whereabouts.LOST
    assert math.isnan(found[-1].x_m)


def test_what_was_lost_is_found_again(room, field):
    localizer = Localizer(field, CAR, START, search_parts=WHOLE)
    stand(localizer, room, START, scans=8)
    found = stand(localizer, room, CORNER, scans=12, begin_s=8 * PERIOD_S)
    assert found[-1].whereabouts is Whereabouts.LOCATED
    assert at(found[-1]) == pytest.approx(CORNER, abs=0.03)


def test_a_covered_lidar_is_no_evidence_of_being_lost(room, field):
    localizer = Localizer(field, CAR, START)
    stand(localizer, room, START, scans=8)
    covered = stand(localizer, room, START, scans=60, begin_s=8 * PERIOD_S, keep=np.zeros(BEAMS, bool))
    assert {one.whereabouts for one in covered} == {Whereabouts.LOCATED}
    assert covered[-1].std_m > covered[0].std_m
    again = stand(localizer, room, START, scans=4, begin_s=68 * PERIOD_S)
    assert at(again[-1]) == pytest.approx(START, abs=0.02)


def test_people_over_half_of_the_view_are_no_evidence_either(room, field):
    localizer = Localizer(field, CAR, START)
    stand(localizer, room, START, scans=8)
    for number in range(60):
        scan = room.scan(START, stamp_s=(8 + number) * PERIOD_S, noise_m=0.01, seed=number)
        last = localizer.localize(among_people(scan), report(scan.stamp_s))
        assert last.whereabouts is Whereabouts.LOCATED
    assert at(last) == pytest.approx(START, abs=0.02)


@pytest.mark.parametrize(("steers", "lost"), [(-1.0, False), (1.0, True)])
def test_a_pose_that_turns_the_other_way_than_the_wheels_is_lost(steers, lost):
    """Among people, who leave a share of beams that a place where the scene is alike has, too."""
    room, radius_m = Room([(-1.0, -1.0, 11.0, 7.0)], [(8.0, -1.0, 9.0, 0.0)]), 2.5
    whereabouts, localizer = set(), Localizer(field_of_cells(room.cells), CAR, (5.0, 5.5, 0.0))
    for number in range(100):  # a circle to the right
        stamp_s, turn = number * PERIOD_S, 0.05 * number / radius_m
        pose = 5.0 + radius_m * math.sin(turn), 3.0 + radius_m * math.cos(turn), -turn
        scan = room.scan(pose, stamp_s=stamp_s, noise_m=0.01, seed=number, number=number)
        steering_rad = steers * math.atan(CAR.wheelbase_m / radius_m)
        wheels = report(stamp_s, 0.05 * number, 2.0, steering_rad)
        whereabouts.add(localizer.localize(among_people(scan), wheels).whereabouts)
    assert Whereabouts.LOCATED in whereabouts
    assert (Whereabouts.LOST in whereabouts) is lost


def test_it_rolls_on_with_the_wheels_and_without_their_reports(room, field):
    for reports in (True, False):
        localizer = Localizer(field, CAR, START)
        for number in range(200):
            stamp_s, way_m = number * PERIOD_S, 0.05 * number * (number < 90)
            scan = room.scan((min(way_m, 9.0), 0.1, 0.0), stamp_s=stamp_s, noise_m=0.01, seed=number)
            last = localizer.localize(scan, report(stamp_s, way_m, 2.0) if reports else None)
            if number == 85:
                break
        assert last.whereabouts is Whereabouts.LOCATED
        assert at(last) == pytest.approx((way_m, 0.1, 0.0), abs=0.04)


def test_the_same_scans_give_the_same_poses_to_the_bit(room):
    first, second = (
        stand(Localizer(field_of_cells(room.cells), CAR, None), room, ELSEWHERE, scans=150) for _ in range(2)
    )
    assert [str(one) for one in first] == [str(one) for one in second]
