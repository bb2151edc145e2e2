"""The pose in the car: found with the answer's own report, published, and told in the status."""

import json
import math

import pytest

from tests.runtime.control.localization.rooms import report, ring
from wallride.clients.status import pose_words
from wallride.runtime.control.localization.line_field import field_of_cells
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.line_files import course_of
from wallride.runtime.map_files import CarMap
from wallride.runtime.tasks.pose import PoseTeller
from wallride.runtime.wire import topics

START = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def room():
    room = ring()
    return room, CarMap("lab", field_of_cells(room.cells), start=START)


class Finder:
    """A car that finds and tells its pose."""

    def __init__(self, known, start, race=dict):
        self.localizer = course_of(known, start, CarSettings()).localizer
        self.teller = PoseTeller(known.name, race)
        self.status = self.teller.status

    def learn(self, scan, motor):
        self.teller.tell(self.localizer.take(scan, motor))


def finder(known, start="lap", **more):
    found = []
    one = Finder(known, start, **more)
    one.teller.publish = found.append
    return one, found


def words(one):
    """Return the status line as a client prints it, after the wire."""
    return pose_words(json.loads(topics.encode(dict(one.status()))))


def test_each_scan_is_located_and_published_with_the_report_of_its_answer(room):
    known = room[1]
    one, found = finder(known)
    for number in range(6):
        one.learn(room[0].scan(START, stamp_s=0.025 * number, noise_m=0.01, seed=number), report(0.025 * number))
    assert len(found) == 6
    assert (found[-1].x_m, found[-1].y_m, found[-1].yaw_rad) == pytest.approx(START, abs=0.02)
    assert words(one).startswith("on lab: x ")
    assert "known to" in words(one)
    assert "of the beams fit" in words(one)


def test_without_a_place_the_status_says_what_is_known(room):
    one, found = finder(room[1], "anywhere")
    assert words(one) == "on lab: being looked for"
    for number in range(400):
        one.learn(room[0].scan((9.9, 0.2, 0.5), stamp_s=0.025 * number, noise_m=0.01, seed=number), None)
        if found[-1].alike:
            break
    assert words(one).startswith("on lab: AMBIGUOUS: these places look alike: x ")
    assert math.isnan(found[-1].x_m)


def test_a_lost_place_is_said(room):
    one, _ = finder(room[1])
    for number in range(20):
        pose = START if number < 8 else (9.8, 5.9, -0.7)
        one.learn(room[0].scan(pose, stamp_s=0.025 * number, noise_m=0.01, seed=number), None)
    assert words(one) == "on lab: LOST, it is looked for everywhere"


def test_laps_are_said_behind_the_place(room):
    race = {
        "laps": 3,
        "time_s": 14.2,
        "best_s": 13.9,
        "rms_m": 0.021,
        "p99_m": 0.06,
        "largest_m": 0.1,
        "speed_share": 1,
    }
    one, _ = finder(room[1], race=lambda: race)
    for number in range(3):
        one.learn(room[0].scan(START, stamp_s=0.025 * number, noise_m=0.01, seed=number), report(0.025 * number))
    assert words(one).endswith("; lap 3: 14.20 s, best 13.90 s, 2.1 cm from the line (rms), 6 cm in 99 % of it")


def test_a_car_without_a_map_has_no_line():
    assert pose_words({}) == ""
