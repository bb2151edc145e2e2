"""A speed at which the motor does not turn is warned of before the car is to drive at it, and said while it stands."""

import asyncio

import pytest

from wallride.cli import main
from wallride.doctor.slow_speeds import SPEEDS, too_slow_to_turn
from wallride.runtime.app import Car
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

SETTINGS = ("operator.permit=always", "battery.settle_s=0", "recording.enabled=false", "wall_follow.speed_mps=0.15")


def test_the_defaults_turn_the_motor():
    assert too_slow_to_turn(Settings()) == ()


@pytest.mark.parametrize("name", SPEEDS)
def test_every_speed_below_the_motor_s_slowest_is_named(name):
    settings = load_settings(None, ["motor.min_speed_mps=0.4", f"{name}=0.3"])
    words = f"{name} = 0.3 m/s is less than motor.min_speed_mps = 0.4 m/s: the motor does not turn at it"
    assert words in too_slow_to_turn(settings)


def test_a_stop_that_is_meant_is_none():
    assert too_slow_to_turn(load_settings(None, ["safety.creep_mps=0"])) == ()


def test_check_warns_and_takes_the_file(tmp_path, capsys):
    file = tmp_path / "car.toml"
    file.write_text("[wall_follow]\nspeed_mps = 0.15\n")
    assert main(["check", str(file)]) == 0
    assert "wallride: wall_follow.speed_mps = 0.15 m/s is less than" in capsys.readouterr().err


async def asked_for_too_little():
    """Return the status after 2 s."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    twin = TwinWorld(load_world("corridor"), loop.time)
    lidar, motor, bus = WorldLidar(twin, loop.time), WorldMotor(twin, loop.time), MemoryBus(loop.time, listened_to=True)
    car = Car(load_settings(None, SETTINGS), lidar, motor, bus, loop.time)
    driving = loop.create_task(car.drive(stop))
    await asyncio.sleep(2.0)
    status = car.status()
    stop.set()
    await driving
    return status


def test_a_car_that_is_asked_for_too_little_says_why_it_stands():
    status = run_virtual(asked_for_too_little())
    assert status["output"]["asked_mps"] == 0.15
    assert (status["state"], status["condition"]["state"]) == ("standing", "stopped")
    assert status["condition"]["reason"].startswith("the motor does not turn below motor.min_speed_mps = 0.2 m/s")
