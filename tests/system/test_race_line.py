"""Laps on a race line by the pose that the car finds itself, and the pose lost in the middle of a lap at speed."""

import math

import numpy as np
import pytest

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.laws import LawStack
from wallride.runtime.control.line_following import line_follower
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.line_field import field_of_cells
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.localization.wall_points import MapCells
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.raceline import race_line
from wallride.sim.racing.ring import ring_of
from wallride.sim.racing.speed_profile import Grip
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.worlds import load_world

WORLD = load_world("loop")
CELL_M = 0.05
WALL = {line_follower.UNKNOWN, line_follower.WRONG_WAY, line_follower.BLOCKED}


@pytest.fixture(scope="module")
def known():
    """Return the field of the world's walls, and its race line."""
    ends = WORLD.outline_m
    share = np.linspace(0.0, 1.0, 1200)[:, None, None]
    points = (ends[:, :2] + share * (ends[:, 2:] - ends[:, :2])).reshape(-1, 2)
    low = points.min(axis=0) - 0.5
    cells = ((points - low) / CELL_M).astype(int)
    wall = np.zeros(cells.max(axis=0)[::-1] + 11, dtype=bool)
    wall[cells[:, 1], cells[:, 0]] = True
    field = field_of_cells(MapCells(wall, ~wall, CELL_M, complex(*low)))
    found = race_line(ring_of(WORLD), FreeSpace(WORLD.outline_m), Grip(), keep_m=0.45, radius_m=0.933)
    line = CourseLine(
        found.x_m + 1j * found.y_m, found.along_m, found.yaw_rad, found.curvature_radpm, found.speed_mps, found.length_m
    )
    return field, line


class Moved(Localizer):
    """A pose that is elsewhere from one scan on, as of a car that was lifted."""

    at, by = math.inf, (0.0, 0.0, 0.0)

    def take(self, scan: Scan, motor: MotorState | None):
        if scan.sequence == self.at:
            self.at = math.inf
            self._filter.state[:3] += self.by
        return super().take(scan, motor)


def raced(known, *, duration_s, at=math.inf, by=(0.0, 0.0, 0.0), cover=None, sets=(), mu=0.8):
    settings = load_settings(
        None, ["wall_follow.method=line", "wall_follow.first_lap_share=0.8", "car.max_speed_mps=6", *sets]
    )
    start = WORLD.start
    localizer = Moved(known[0], settings.car, (start.x_m, start.y_m, start.yaw_rad), 1.0)
    localizer.at, localizer.by = at, by
    course = RaceCourse("loop", known[0], localizer, known[1])
    laws = LawStack(settings.wall_follow, settings.safety, settings.car, course=course)
    vehicle = VehicleSettings(trim_rad=0.02, grip_mu=mu)
    case = Case(WORLD, duration_s=duration_s, vehicle=vehicle, car=settings.car, seed=3, cover=cover)
    return drive(case, laws.follower, laws.judge), laws


def aside_m(known, run, since_s):
    late = run.time_s > since_s
    return np.abs([known[1].nearest(complex(x_m, y_m)).aside_m for x_m, y_m, _ in run.pose[late]])


@pytest.mark.slow
def test_laps_are_driven_on_the_line(known):
    run, laws = raced(known, duration_s=26.0)
    assert run.contact is None
    off_m = aside_m(known, run, 14.0)
    assert np.sqrt(np.mean(off_m**2)) < 0.06
    assert np.percentile(off_m, 99) < 0.15
    assert laws.driver.figures["laps"] >= 2
    assert laws.driver.figures["rms_m"] < 0.06
    assert laws.driver.figures["time_s"] < 8.0, "6.7 s in theory"
    assert run.speed_mps[:, 0].max() > 5.0


@pytest.mark.slow
def test_a_line_for_a_floor_with_twice_the_grip_is_driven_as_fast_as_the_floor_allows(known):
    run, laws = raced(known, duration_s=40.0, sets=["wall_follow.first_lap_share=0.6"], mu=0.4)
    assert run.contact is None
    assert not [stop for stop in run.stops if stop.speed_mps > 0.3], "two without the bound by the grip"
    assert laws.driver.figures["laps"] >= 4
    assert laws.driver.figures["p99_m"] < 0.1


@pytest.mark.parametrize(("at", "by"), [(250, (2.0, -1.5, 0.4)), (265, (-1.0, 2.5, -0.9))])
def test_a_car_whose_pose_is_lost_at_speed_is_on_the_wall_or_stands(known, at, by):
    run, _ = raced(known, duration_s=at * 0.025 + 3.0, at=at, by=by)
    assert run.contact is None
    assert run.speed_mps[at, 0] > 3.5
    after = run.reasons[at + 1 : at + 30]
    assert any(reason in WALL or "wall" in reason for reason in after), after
    assert run.speed_mps[at + 60 : at + 100, 0].max() < 3.0, "safety and the ball have slowed it"


def test_a_car_whose_lidar_is_covered_stands(known):
    def covered(ranges_mm, time_s):
        return np.where(time_s > 7.25, 0, ranges_mm)

    run, _ = raced(known, duration_s=9.5, cover=covered)
    assert run.contact is None
    assert abs(run.speed_mps[-1, 0]) < 0.1
