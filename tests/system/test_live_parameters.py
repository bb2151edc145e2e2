"""Settings of the whole car, changed while it drives: over a real session, and in virtual time for exact seconds."""

import asyncio
import json
import statistics
import time

import pytest

from tests.system.timed_drive import drive_for
from tests.waiting import until
from wallride.clients.parameters import ask
from wallride.drivers.api import Drive
from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.arbitration.command import DriveCommand, Source
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.runtime.wire import zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.virtual.devices import MemoryBus, MemoryLidar, MemoryMotor, ranges_between_walls
from wallride.sim.virtual.virtual_time import run_virtual

SCAN_S = 0.025
# The scans do not move with the car, which only the report's laws do not mind.
SECTIONS = {
    "battery": {"settle_s": 0},
    "operator": {"permit": "always"},
    "wall_follow": {"method": "report", "kp": 0.2},
    "safety": {"method": "report"},
}


class Lab:
    """A car between two walls that are 0.05 m farther away than wanted."""

    def __init__(self, clock, file=None, bus=None):
        self.settings = Settings.model_validate(SECTIONS)
        self.motor = MemoryMotor(clock)
        self.scan_times_s = []
        self.lidar = MemoryLidar(self._scan, clock)
        bus = bus or MemoryBus(clock, listened_to=False)
        self.car = Car(self.settings, self.lidar, self.motor, bus, clock, CarSurroundings(file))

    def _scan(self, now_s):
        self.scan_times_s.append(now_s)
        return ranges_between_walls(1.05, 1.05)

    def set(self, **wishes):
        values = {name.replace("__", "."): value for name, value in wishes.items()}
        return json.loads(self.car.parameters.set_some(json.dumps({"values": values}).encode()))

    def steering_at_rad(self, at_s):
        return [drive for when_s, drive in self.motor.wire if when_s <= at_s][-1].steering_rad

    def speed_at_mps(self, at_s):
        return [drive for when_s, drive in self.motor.wire if when_s <= at_s][-1].speed_mps


def virtual(seconds, *events):
    """Drive for so long in virtual time; events are (time, function of the lab)."""

    async def main():
        lab = Lab(asyncio.get_running_loop().time)
        await drive_for(seconds, lab.car, lab, events)
        return lab

    return run_virtual(main())


@pytest.mark.parametrize("at_s", [2.0, 2.004, 2.011, 2.0249, 2.025, 2.0251])
def test_a_new_gain_steers_within_two_scans_and_nothing_else_changes(at_s):
    lab = virtual(2.5, (at_s, lambda lab: lab.set(wall_follow__kp=1.0)))
    before_rad = lab.steering_at_rad(at_s - 0.001)
    soon = [drive.steering_rad for when_s, drive in lab.motor.wire if at_s <= when_s < at_s + 2 * SCAN_S + 0.001]
    assert max(soon) - before_rad == pytest.approx(0.8 * 0.05, abs=0.005), "0.8 more, for an error of 0.05 m"
    assert {drive.speed_mps for when_s, drive in lab.motor.wire if 1.5 < when_s < 2.49} == {1.0}


def test_the_other_wall_is_followed_at_once():
    lab = virtual(2.5, (2.0, lambda lab: lab.set(wall_follow__side="right")))
    assert lab.steering_at_rad(1.99) > 0 > lab.steering_at_rad(2.2)


def test_a_lower_limit_holds_at_once_and_a_higher_one_is_refused():
    def raise_it(lab):
        with pytest.raises(Exception, match="loosens safety while the car drives"):
            lab.set(car__max_speed_mps=5.0)

    lab = virtual(4.0, (2.0, raise_it), (3.0, lambda lab: lab.set(car__max_speed_mps=0.5)))
    assert lab.speed_at_mps(2.9) == 1.0
    assert lab.speed_at_mps(3.0 + SCAN_S) == 0.5
    assert lab.car.settings.car.max_speed_mps == 0.5


def test_a_law_is_exchanged_only_while_the_car_stands():
    def exchange(lab):
        lab.set(wall_follow__method="ball")

    def try_it(lab):
        with pytest.raises(Exception, match="only while the car stands"):
            exchange(lab)

    def stop(lab):
        lab.set(wall_follow__speed_mps=0.0)

    lab = virtual(
        6.0, (2.0, try_it), (3.0, stop), (4.0, exchange), (4.5, lambda lab: lab.set(wall_follow__speed_mps=1.0))
    )
    assert lab.car.laws.wall_follow.method == "ball"
    assert lab.speed_at_mps(3.5) == 0.0
    assert lab.speed_at_mps(5.9) == 1.0


def test_binding_the_human_binds_him_at_the_next_decision():
    def push(lab):
        word = DriveCommand(Source.TELEOP, Drive(0.7, 0.0), None, "stick")
        lab.car.queue.put(word, expires_at_s=lab.car.clock() + 0.2)

    def bind(lab):
        lab.set(safety__binds_teleop=True)
        lab.lidar.late_s = 10.0  # from here on safety has nothing to say

    pushes = [(2.0 + 0.05 * n, push) for n in range(60)]
    lab = virtual(5.0, *pushes, (3.0, bind))
    assert lab.speed_at_mps(2.9) == 0.7
    assert lab.car.queue.order == lab.car.settings.effective_order()
    assert lab.speed_at_mps(3.5) == 0.0, "bound to a safety that is silent"


def test_a_shorter_expiry_is_obeyed():
    def blink(lab):
        lab.set(wall_follow__expires_after_s=0.01, safety__expires_after_s=0.01)

    lab = virtual(4.0, (3.0, blink))
    stops = [when_s for when_s, drive in lab.motor.wire if 3.1 < when_s < 3.9 and drive.speed_mps == 0]
    assert stops, "words that expire before the next scan let the car stop in between"


async def test_over_the_bus_a_new_gain_steers_within_two_scans(tmp_path):
    endpoint, file = free_endpoint(), tmp_path / "car.toml"
    file.write_text("# my car\n[wall_follow]\nmethod = 'report'\nkp = 0.2  # gentle\n[safety]\nmethod = 'report'\n")
    bus = CarBus(zenoh_config.car_config([endpoint], None, (), "car1"))
    client = Bus(zenoh_config.client_config(endpoint, None))
    lab = Lab(time.monotonic, file=file, bus=bus)
    lab.car.connect()
    await bus.open()
    await client.open()
    stop = asyncio.Event()
    driving = asyncio.create_task(lab.car.drive(stop))
    scans = []
    try:
        await until(lambda: len(lab.scan_times_s) > 60)
        for kp in (1.0, 0.2) * 10:
            wire_length = len(lab.motor.wire)
            before_rad = lab.motor.wire[-1][1].steering_rad
            answer = await ask(client, "car1", "set", values={"wall_follow.kp": kp}, by="test")
            assert answer["changed"][0]["new"] == kp
            applied_s = lab.car.history.newest(1)[0].stamp_s
            target_rad = before_rad + (0.8 if kp > 0.5 else -0.8) * 0.05

            def has_turned(target_rad=target_rad, since=wire_length):
                return any(abs(drive.steering_rad - target_rad) < 0.008 for _, drive in lab.motor.wire[since:])

            await until(has_turned)
            turned_s = next(
                at_s for at_s, drive in lab.motor.wire[wire_length:] if abs(drive.steering_rad - target_rad) < 0.008
            )
            scans.append(sum(applied_s < at_s <= turned_s for at_s in lab.scan_times_s))
            await asyncio.sleep(0.1)  # below the turnstile's rate
        assert max(scans) <= 2, scans
        assert statistics.median(scans) == 1
        with pytest.raises(RefusedError, match="must be a number from 0 to 20 rad/m"):
            await ask(client, "car1", "set", values={"wall_follow.kp": 99})
        await ask(client, "car1", "set", values={"wall_follow.kp": 0.5})
        saved = await ask(client, "car1", "save", timeout_s=10)
        assert saved["saved"] == ["wall_follow.kp"]
        assert load_settings(file).wall_follow.kp == 0.5
        assert "# gentle" in file.read_text()
        history = (await ask(client, "car1", "history", most=2))["changes"]
        assert [change["new"] for change in history] == [0.2, 0.5]
        assert history[0]["by"] == "test"
    finally:
        stop.set()
        await driving
        await client.close()
        await bus.close()
