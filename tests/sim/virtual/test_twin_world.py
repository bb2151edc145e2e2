"""A simulated car behind in-memory devices: moved by the clock alone, and by nothing else."""

import numpy as np
import pytest

from tests.runtime.observed import HandClock
from wallride.drivers.api import Drive
from wallride.sim.car.vehicle import BrakeDemand, SpeedDemand, Vehicle
from wallride.sim.virtual.twin_world import TwinWorld, WorldMotor, demand_of
from wallride.sim.world.obstacles import pole
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world


@pytest.fixture
def clock():
    return HandClock(0.0)


def test_nothing_moves_but_by_the_clock(clock):
    twin = TwinWorld(load_world("straight"), clock)
    motor = WorldMotor(twin, clock)
    assert motor.send(Drive(1.0, 0.0))
    twin.advance()
    assert twin.vehicle.pose == twin.world.start
    clock.now_s = 2.0
    state = motor.state
    assert state is not None
    assert state.speed_mps == pytest.approx(1.0, abs=0.02)
    assert state.distance_m == pytest.approx(twin.way_m, abs=0.02)
    assert twin.vehicle.pose.x_m == pytest.approx(twin.way_m, abs=1e-6)


def test_the_lidar_sees_the_car_come_nearer(clock):
    twin = TwinWorld(load_world("dead_end"), clock)
    before_m = np.nanmedian(twin.ranges_at(0.0)[535:546])
    WorldMotor(twin, clock).send(Drive(2.0, 0.0))
    clock.now_s = 2.0
    after_m = np.nanmedian(twin.ranges_at(2.0)[535:546])
    assert twin.way_m > 1.0
    assert before_m - after_m == pytest.approx(twin.way_m, abs=0.05)


def test_who_touches_something_stops_dead_there(clock):
    twin = TwinWorld(load_world("straight"), clock, start=Pose(0.0, 0.0, 0.0), obstacles=(pole(2.0, 0.0, 0.05),))
    twin.ranges_at(0.0)
    WorldMotor(twin, clock).send(Drive(2.0, 0.0))
    clock.now_s = 4.0
    twin.advance()
    assert twin.contact_mps == pytest.approx(2.0, abs=0.1)
    assert twin.vehicle.pose.x_m == pytest.approx(2.0 - 0.05 - 0.42, abs=0.02)
    assert twin.vehicle.speed_mps == 0.0


def test_commands_become_what_the_driver_makes_of_them():
    standing, rolling = Vehicle(), Vehicle()
    rolling.place(Pose(0.0, 0.0, 0.0), speed_mps=1.0)
    assert demand_of(Drive(1.0, 0.0), standing) == SpeedDemand(1.0)
    assert demand_of(Drive(-0.4, 0.0), standing) == SpeedDemand(-0.4)
    assert isinstance(demand_of(Drive(-0.4, 0.0), rolling), BrakeDemand), "against the motion: brake first"
    assert isinstance(demand_of(Drive(0.1, 0.0), rolling), BrakeDemand), "too slow for the motor to hold"
    full, gentle = demand_of(Drive(0.0, 0.0), rolling), demand_of(Drive(0.0, 0.0, brake_mps2=2.0), rolling)
    assert isinstance(full, BrakeDemand)
    assert isinstance(gentle, BrakeDemand)
    assert full.current_a == pytest.approx(50.0)
    assert gentle.current_a == pytest.approx((2.0 - 0.4) / 0.17)
