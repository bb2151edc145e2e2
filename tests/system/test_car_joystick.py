"""A gamepad on the car, in the whole runtime in virtual time: what reaches the motor when it is held and pulled."""

import asyncio
import math
from functools import partial

import pytest

from tests.clients.joystick.fake_pads import LB, LEFT_Y, FakePad
from wallride.clients.joystick.car_joystick import CarJoystick
from wallride.clients.joystick.devices import LinuxPads
from wallride.clients.joystick.evdev import EV_ABS, EV_KEY
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.settings.tree import Settings
from wallride.sim.virtual.devices import MemoryBus, MemoryLidar, MemoryMotor, ranges_between_walls
from wallride.sim.virtual.virtual_time import run_virtual

LOST_WITHIN_S = 0.25
SHAPE = InputShape(max_speed_mps=1.0, ramp_mps2=math.inf)


class PadStory:
    """A car between two walls and a pad in its first USB port."""

    def __init__(self, folder, permit):
        self.folder, self.devices = folder, {}
        self.pads = LinuxPads(folder, lambda path: self.devices[path])
        # The scans here do not move with the car, which only the report's laws do not mind.
        laws = {name: {"method": "report"} for name in ("wall_follow", "safety")}
        self.settings = Settings.model_validate({"battery": {"settle_s": 0}, "operator": {"permit": permit}, **laws})
        self.pad = FakePad()

    def plug(self, *, held=False):
        self.pad = FakePad()
        if held:
            self.pad.values[EV_KEY, LB], self.pad.values[EV_ABS, LEFT_Y] = 1, -32767
        path = self.folder / "event3"
        self.devices = {path: self.pad}
        path.touch()
        for opened in self.pads.open_all(self.pads.untried()):
            self.pads.adopt(*opened)

    def unplug(self):
        self.pad.pulled = True
        (self.folder / "event3").unlink()

    def hold(self):
        self.pad.hold(LB)

    def release(self):
        self.pad.push(0.0)
        self.pad.hold()

    def push(self):
        self.pad.push(1.0)

    def run(self, seconds, *events):
        """Drive for so long; events are (time, method)."""

        async def jitter():
            while True:
                await asyncio.sleep(0.05)
                if not self.pad.pulled:
                    self.pad.jitter()

        async def main():
            loop = asyncio.get_running_loop()
            self.motor = MemoryMotor(loop.time)
            lidar = MemoryLidar(lambda _: ranges_between_walls(1.0, 1.0), loop.time)
            around = CarSurroundings(joystick=CarJoystick(self.pads, 77, SHAPE))
            car = Car(self.settings, lidar, self.motor, MemoryBus(loop.time), loop.time, around)
            stop, hand = asyncio.Event(), asyncio.create_task(jitter())
            for at_s, event in events:
                loop.call_at(at_s, event)
            loop.call_at(seconds, stop.set)
            await car.drive(stop)
            hand.cancel()

        run_virtual(main())

    def speeds(self, from_s, to_s):
        """Return every speed that was sent to the motor in between."""
        return [drive.speed_mps for at_s, drive in self.motor.wire if from_s <= at_s < to_s]


@pytest.fixture(params=["required", "always"])
def story(request, tmp_path):
    return PadStory(tmp_path, request.param)


def grab(story, from_s):
    return (from_s, story.hold), (from_s + 0.2, story.push)


def test_after_power_on_the_pad_drives_and_a_release_stops(tmp_path):
    story = PadStory(tmp_path, "required")
    story.run(3.0, (0.5, story.plug), *grab(story, 1.0), (2.0, story.release))
    assert set(story.speeds(0.0, 1.2)) == {0.0}
    assert max(story.speeds(1.2, 2.0)) > 0.9
    assert set(story.speeds(2.05, 3.0)) == {0.0}


def test_a_pad_that_is_pulled_brakes_and_drives_again_after_a_release_alone(story):
    events = [
        (0.1, story.plug), *grab(story, 1.0), (2.0, story.unplug), (3.0, partial(story.plug, held=True)),
        (4.0, story.release), *grab(story, 4.5),
    ]  # fmt: skip
    story.run(5.5, *events)
    assert max(story.speeds(1.2, 2.0)) > 0.9
    assert set(story.speeds(2.0 + LOST_WITHIN_S, 4.6)) == {0.0}, "autonomy does not take over, nor a held deadman"
    assert max(story.speeds(4.7, 5.5)) > 0.9
