"""Bends near the grip of a slippery floor, driven: the car runs wider than its wheels point, and safety sees it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wallride.drivers.api import Drive
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.walls import case_of
from wallride.sim.lab.laws import drive_case
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry

CAR = CarSettings()
HALL_AND_LANE_M = np.array(
    [
        (-6.5, 2.5, -1.45, 2.5), (-1.45, 2.5, -1.45, 0.8), (-1.45, -0.8, -1.45, -2.5), (-1.45, -2.5, -6.5, -2.5),
        (-6.5, -2.5, -6.5, 2.5), (-1.45, 0.8, 4.5, 0.8), (4.5, 0.8, 4.5, -0.8), (4.5, -0.8, -1.45, -0.8),
    ]
)  # fmt: skip
START = Pose(-2.31, -0.6, 1.385)
FAST_MPS = 1.85


class HoldsItsBend:
    """A driver that keeps full lock to the right, whatever it sees."""

    def follow(self, scan, motor):
        return Guidance(Drive(FAST_MPS, -CAR.max_steering_rad), math.nan, math.nan, math.nan, "holds its bend")


def driven(off_m, seed, mu):
    """Turn out of a hall into a lane, the post of its door on the outside of the bend; off_m: how far off to start."""
    start = Pose(
        START.x_m - off_m * math.sin(START.yaw_rad), START.y_m + off_m * math.cos(START.yaw_rad), START.yaw_rad
    )
    guard = SweptGuard(SweptSettings(), CAR)
    case = Case(
        World("hall and lane", SegmentGeometry(HALL_AND_LANE_M), start), None, FAST_MPS, side="right", duration_s=1.2,
        vehicle=VehicleSettings(grip_mu=mu), seed=seed,
    )  # fmt: skip
    return drive(case, HoldsItsBend(), guard)


@pytest.mark.parametrize("off_m", [-0.14, -0.1, -0.06, -0.02, 0.02, 0.06])
def test_a_bend_that_runs_wide_on_a_slippery_floor_is_braked_before_what_is_outside_it(off_m):
    for seed in (7, 8):
        assert driven(off_m, seed, mu=0.5).contact is None


def test_a_bend_with_room_is_driven():
    done = driven(-0.5, seed=7, mu=0.8)
    assert done.contact is None
    assert not done.stops


@pytest.mark.parametrize(
    ("side", "seed"), [("left", 9008), ("left", 9012), ("left", 9013), ("left", 9207), ("right", 9028)]
)
def test_a_turn_that_passes_a_wall_by_millimetres_is_not_given_up_for_noise(side, seed):
    """0.5 m from the wall, 20 degrees toward it, 3 m/s: in these the wheels turned back and forth, and it touched."""
    case = replace(case_of("t1", 3.0, 0.5, side, seed), duration_s=1.0)
    assert drive_case(Cell("walls", "t1", "ball", 3.0, 0.5, side, seed), case).contact is None
