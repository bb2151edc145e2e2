"""What counts as backing blindly: everything but the car's own track of a moment ago, and not much of that."""

import numpy as np
import pytest

from tests.runtime.control.scans import CAR, scan_of
from wallride.runtime.control.perception.geometry import Places
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.perception.obstacles.rear_memory import TRACK_FOR_S, TRACK_M, RearMemory
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import ViewCache
from wallride.sim.virtual.devices import BEAMS


class Rolling:
    """A car that rolls along x and keeps what it sees."""

    def __init__(self):
        self.behind = RearMemory(CAR.lidar_x_m)
        self.eyes = ViewCache(CAR)
        self.x_m = self.now_s = 0.0

    def roll(self, way_m, *, y_m=0.0, yaw_rad=0.0):
        steps = round(abs(way_m) / 0.02)
        for _ in range(steps):
            self.x_m += way_m / steps
            self.now_s += 0.05
            self.behind.move(OdometryState(self.x_m, y_m, yaw_rad), way_m / steps)
            self.behind.keep(self.eyes.see(scan_of(np.full(BEAMS, 2.0), self.now_s)))
        return self.behind.backed_m


def test_backing_where_the_car_was_never_is_backing_blindly():
    assert Rolling().roll(-0.3) == pytest.approx(0.3)


def test_backing_on_the_own_track_is_not():
    car = Rolling()
    car.roll(2.0)
    assert car.roll(-1.0) == 0.0


def test_the_own_track_ends_where_the_car_began():
    car = Rolling()
    car.roll(0.5)
    assert car.roll(-0.9) == pytest.approx(0.9 - 0.4, abs=0.06)


def test_no_more_of_the_own_track_than_allowed():
    car = Rolling()
    car.roll(3.0)
    assert car.roll(-TRACK_M) <= 0.03
    assert car.roll(-0.3) == pytest.approx(0.3, abs=0.03)
    car.roll(1.0)
    assert car.roll(-0.9) < 0.3


@pytest.mark.parametrize("aside", [{"y_m": 0.15}, {"yaw_rad": 0.4}])
def test_beside_the_own_track_or_turned_is_not_on_it(aside):
    car = Rolling()
    car.roll(2.0)
    assert car.roll(-0.4, **aside) == pytest.approx(0.4, abs=0.15)


def test_a_track_of_long_ago_is_none():
    """The car has stood there ever since, and something may have come behind it."""
    car = Rolling()
    car.roll(1.5)
    car.now_s += TRACK_FOR_S + 1.0
    car.roll(0.02)
    assert car.roll(-0.6) == pytest.approx(0.6, abs=0.05)


def test_a_slide_that_the_odometry_has_not_counted_carries_what_is_remembered():
    car = Rolling()
    car.roll(1.0)
    wall_m: Places = np.array([0.3 + 1.0j, 0.0 + 1.0j, -0.5 + 0.8j])  # as seen from the car
    car.behind._seen = car.x_m + wall_m
    moved = ScanPose(0.4 + 0.1j, 1.2)
    kept = [one.place_m for one in car.behind.kept]
    car.behind.slide(moved)
    found = car.behind.points_m(0.0)
    expected = (wall_m - moved.at_m) * np.exp(-1j * moved.yaw_rad)
    assert found == pytest.approx(expected[np.abs(np.angle(expected - CAR.lidar_x_m)) > 0.0], abs=1e-9)
    there = [(place_m - car.x_m - moved.at_m) * np.exp(-1.2j) + car.x_m for place_m in kept]
    assert [one.place_m for one in car.behind.kept] == pytest.approx(there, abs=1e-9)
    assert car.behind.kept[-1].yaw_rad == pytest.approx(-1.2)
    car.roll(0.02)
    assert len(car.behind.kept) == len(kept) + 1, "it is kept anew, where it is now"
