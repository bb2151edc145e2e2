"""A simulated car behind in-memory devices: moved by the clock alone, and by nothing else."""

import asyncio

import numpy as np
import pytest

from wallride.drivers.api import Drive, LinkState
from wallride.sim.car.vehicle import BrakeDemand, SpeedDemand, Vehicle
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor, demand_of
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.obstacles import pole
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world


class Hand:
    """A clock that a hand moves."""

    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return Hand()


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


def test_the_same_story_twice_is_the_same_to_the_last_bit(clock):
    def told():
        clock.now_s = 0.0
        twin = TwinWorld(load_world("straight"), clock, seed=5)
        motor = WorldMotor(twin, clock)
        motor.send(Drive(2.0, 0.1))
        clock.now_s = 0.7
        return twin.ranges_at(0.7), twin.vehicle.pose

    (ranges_m, pose), (again_m, again) = told(), told()
    assert pose == again
    assert np.array_equal(ranges_m, again_m, equal_nan=True)


def test_the_lidar_sees_the_car_come_nearer(clock):
    twin = TwinWorld(load_world("dead_end"), clock)
    before_m = np.nanmedian(twin.ranges_at(0.0)[535:546])
    WorldMotor(twin, clock).send(Drive(2.0, 0.0))
    clock.now_s = 2.0
    after_m = np.nanmedian(twin.ranges_at(2.0)[535:546])
    assert before_m - after_m == pytest.approx(twin.way_m, abs=0.05)


def test_a_pulled_motor_takes_nothing_tells_nothing_and_brakes_by_itself(clock):
    twin = TwinWorld(load_world("straight"), clock)
    motor = WorldMotor(twin, clock)
    motor.send(Drive(2.0, 0.0))
    clock.now_s = 1.5
    motor.pull()
    assert (motor.state, motor.health.link) == (None, LinkState.ABSENT)
    assert not motor.send(Drive(2.0, 0.0))
    motor.brake_by_itself()
    clock.now_s = 3.5
    motor.plug()
    state = motor.state
    assert state is not None
    assert state.speed_mps == 0.0
    assert len(motor.wire) == 1


def test_a_pulled_lidar_is_said_to_be_absent_and_sends_nothing():
    links, seen = [], []

    async def main():
        clock = asyncio.get_running_loop().time
        lidar, scans = WorldLidar(TwinWorld(load_world("straight"), clock), clock), []
        running = asyncio.create_task(lidar.run(scans.append))
        for act in (lidar.pull, lidar.plug):
            act()
            scans.clear()
            await asyncio.sleep(0.2)
            links.append(lidar.health.link)
            seen.append(len(scans) > 0)
        running.cancel()

    run_virtual(main())
    assert links == [LinkState.ABSENT, LinkState.READY]
    assert seen == [False, True]


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
