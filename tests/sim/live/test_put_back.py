"""`wallride sim --put-back`: a contact puts the car back to its start, and the drive goes on."""

from typing import Any, cast

import pytest

from tests.sim.car.test_inertia import WIRING, Controller
from wallride.sim.car.plant import PART_S, PAUSED_S, Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.scenes import WorldScene
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world


@pytest.mark.parametrize("puts_back", [False, True])
def test_a_contact_ends_the_drive_or_puts_the_car_back(puts_back):
    world = load_world("dead_end", side="left")
    vehicle = Vehicle(pose=world.start)
    scene = WorldScene(world, "left", LidarSettings(), None, 0)
    scene.back_to = world.start if puts_back else None
    controller: Any = Controller(2.0, 0.0)  # instead of the emulated one
    plant = Plant(vehicle, controller, WIRING, 0.0)
    touched_s = []
    for step in range(1, 4000):
        plant.advance(step / 200)
        if scene.step(step / 200, vehicle):
            plant.crash()
            touched_s.append(step / 200)
            if len(touched_s) % 200 == 0 and puts_back:
                plant.put_back(world.start)
    assert scene.collided
    assert scene.finished is not puts_back
    assert scene.contacts == 1 if not puts_back else scene.contacts >= 2
    if puts_back:
        plant.put_back(world.start)
        scene.step(20.0, vehicle)
        assert not world.collides(vehicle.pose)


def test_a_world_that_was_stopped_drives_nothing_meanwhile():
    vehicle = Vehicle()
    vehicle.place(Pose(0.0, 0.0, 0.0), speed_mps=2.0)
    controller: Any = Controller(2.0, 0.0)
    plant = Plant(vehicle, controller, WIRING, 0.0)
    assert list(plant.catch_up(0.05)) == pytest.approx([0.02, 0.04, 0.05])
    for _ in plant.catch_up(12.0):
        pass
    assert vehicle.x_m == pytest.approx(2.0 * (0.05 + PAUSED_S), abs=0.02)


def test_a_contact_is_found_between_two_late_steps():
    world = load_world("dead_end", side="left")
    vehicle, controller = Vehicle(pose=world.start), Controller(6.0, 0.0)
    scene = WorldScene(world, "left", LidarSettings(), None, 0)
    plant = Plant(vehicle, cast("Any", controller), WIRING, 0.0)
    step_s, to_s = 0.9 * PAUSED_S, 0.0
    while not scene.collided:
        to_s += step_s
        for at_s in plant.catch_up(to_s):
            if scene.step(at_s, vehicle):
                plant.crash()
    assert world.clearance(vehicle.pose) == pytest.approx(0.0, abs=PART_S * 6.0)
