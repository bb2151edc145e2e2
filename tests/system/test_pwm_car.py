"""A car without a tachometer, whole and in virtual time: the unmodified runtime, a PCA9685 behind its bus, an ESC that
drives a quarter faster than its settings say, and a simulated car whose scans alone tell the speed."""

import asyncio

import numpy as np
import pytest

from wallride.drivers.api import LinkState
from wallride.drivers.pca9685.driver import Pca9685
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.app import Car
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.esc import EmulatedEsc, esc_of
from wallride.sim.devices.pca9685 import Pca9685Chip
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, as_scan
from wallride.sim.virtual.devices import MemoryBus, MemoryLidar
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import scan
from wallride.sim.world.worlds import load_world

LEFT_RAD = np.radians(np.linspace(30.0, 150.0, 121))


class PwmDrive:
    """A drive; `seen` has time, true speed, and distance to the wall on the left, of each scan."""

    def __init__(self, world, speed_mps=1.0):
        self.world = load_world(world)
        self.settings = Settings.model_validate({
            "motor": {"driver": "pca9685"},
            "operator": {"permit": "always"},
            "wall_follow": {"speed_mps": speed_mps},
            "telemetry": {"enabled": False},
        })  # fmt: skip
        self.seen = []
        self.hidden = False

    def run(self, seconds, *events):
        async def main():
            loop = asyncio.get_running_loop()
            self.now = loop.time
            assert isinstance(self.settings.motor, Pca9685Settings)
            self.esc = EmulatedEsc(esc_of(self.settings.motor))
            self.chip = Pca9685Chip(self.esc, clock=loop.time)
            self.vehicle = Vehicle(pose=self.world.start)
            plant, rng = Plant(self.vehicle, self.esc, VescSettings(), loop.time()), np.random.default_rng(5)

            def look(now_s):
                plant.advance(now_s)
                pose = self.vehicle.pose
                wall_m = self.world.cast(pose.x_m, pose.y_m, LEFT_RAD + pose.yaw_rad).min()
                self.seen.append((now_s, self.vehicle.speed_mps, wall_m))
                sent_mm = scan(self.world, pose, self.vehicle.twist, now_s, rng, ROUGH_BEAMS)
                return as_scan(sent_mm, ROUGH_BEAMS, now_s, 0).ranges_m

            self.motor = Pca9685(self.settings.motor, clock=loop.time, open_bus=self.chip.open)
            self.car = Car(self.settings, MemoryLidar(look, loop.time), self.motor, MemoryBus(loop.time), loop.time)
            self.car.connect()
            stop = asyncio.Event()
            for at_s, event in events:
                loop.call_at(at_s, event, self)
            loop.call_at(seconds, stop.set)
            await self.car.drive(stop)

        run_virtual(main())
        return np.array(self.seen)

    def reason(self):
        return self.car.mux.output.decision.reason


def test_it_follows_the_wall_at_one_metre_a_second_by_its_scans_alone():
    seen = PwmDrive("loop").run(30.0)
    moving = seen[seen[:, 0] > 5.0]
    assert np.abs(moving[:, 2] - 1.0).mean() < 0.10
    assert moving[:, 1].mean() == pytest.approx(1.0, abs=0.05)


def test_between_bare_walls_it_is_slow_and_says_so():
    said = []
    drive = PwmDrive("corridor")
    seen = drive.run(10.0, (8.0, lambda it: said.extend(it.car.status()["window"])))
    most_mps = Pca9685Settings().blind_speed_mps
    assert seen[:, 1].max() < 1.4 * most_mps  # its ESC drives 1.25 times as fast as it is said to
    assert seen[-1, 0] > 9.0
    assert any("the scans do not tell the speed" in words for words in said)
    assert any("no command timeout" in words for words in said)


def test_the_last_pulse_brakes():
    drive = PwmDrive("loop")
    drive.run(8.0)
    assert drive.esc.demand(0.0).kind in {"brake", "coast"}
    assert drive.esc.speed_mps is None


@pytest.mark.parametrize("fault", ["nack", "brown-out"])
def test_a_lost_board_stops_the_car_with_its_reason_and_it_comes_back(fault):
    reasons = []

    def break_it(it):
        if fault == "nack":
            it.chip.nack_every = 1
        else:
            it.chip.brown_out()

    def look(it):
        reasons.append((it.motor.health.link, it.motor.health.message, it.reason()))
        it.chip.nack_every = None

    seen = PwmDrive("loop").run(14.0, (7.0, break_it), (7.3, look))
    link, message, _ = reasons[0]
    assert link is not LinkState.READY
    assert ("no acknowledgement" if fault == "nack" else "it was reset while it drove") in message or "arm" in message
    assert seen[(seen[:, 0] > 7.2) & (seen[:, 0] < 10.0), 1].min() < 0.05
    assert seen[-1, 1] > 0.5


def test_an_esc_that_is_off_is_a_fault_with_its_remedy():
    faults = []

    def switch_off(it):
        it.esc.pulse = lambda *_: None
        it.esc.no_signal()

    PwmDrive("loop").run(14.0, (6.0, switch_off), (13.0, lambda it: faults.append(it.motor.state.fault)))
    assert "the scans show no motion" in faults[0]
