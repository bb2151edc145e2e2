"""A mistake beside the way from lidar to motor is counted, named and tried again; one on that way ends the drive."""

import asyncio

import pytest

from wallride.runtime.app import Car
from wallride.runtime.settings.tree import load_settings
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

SETTINGS = ("operator.permit=always", "battery.settle_s=0", "recording.enabled=false", "wall_follow.speed_mps=1.0")


def broken(*_args, **_more):
    raise AttributeError("a mistake")


async def drive():
    """Return the status after 2.5 s, with the true speed."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    twin = TwinWorld(load_world("corridor"), loop.time)
    motor = WorldMotor(twin, loop.time)
    car = Car(
        load_settings(None, SETTINGS), WorldLidar(twin, loop.time), motor, MemoryBus(loop.time, listened_to=True),
        loop.time,
    )  # fmt: skip
    driving = loop.create_task(car.drive(stop))
    await asyncio.sleep(2.5)
    found = car.status(), twin.vehicle.speed_mps
    stop.set()
    await driving
    return found


@pytest.mark.parametrize(
    ("mistake", "named"),
    [
        ("wallride.runtime.telemetry.topic_writers.TopicWriters._diagnostics", "writing diagnostics failed "),
        ("wallride.runtime.telemetry.sinks.ZenohSink.take", "sending output failed "),
        ("wallride.runtime.control.score.Score.add", "telemetry failed "),
        ("wallride.runtime.arbitration.driving_state.DrivingStateMonitor.update", "telemetry failed "),
        ("wallride.runtime.control.laws.LiveLaws.learn", "learning failed "),
        ("wallride.runtime.tasks.own_parts.OwnPartsKeeper.is_due", "the file of own parts failed "),
        ("wallride.sim.virtual.devices.MemoryBus.poll", "polling the network failed "),
    ],
)
def test_a_mistake_beside_the_way_does_not_end_the_drive_and_is_named(monkeypatch, mistake, named):
    monkeypatch.setattr(mistake, broken)
    status, speed_mps = run_virtual(drive())
    (words,) = [line for line in status["window"] if line.startswith(named)]
    assert "the drive goes on: AttributeError: a mistake (test_side_work.py:" in words
    assert speed_mps > 0.8


@pytest.mark.parametrize("mistake", ["look", "follow"])
def test_a_mistake_of_what_decides_ends_the_drive(monkeypatch, mistake):
    monkeypatch.setattr(f"wallride.runtime.control.laws.LiveLaws.{mistake}", broken)
    with pytest.raises(ExceptionGroup):
        run_virtual(drive())
