"""A lap, its map, its line, and the race along that: on a car that is restarted once, and whose file no one edits."""

import asyncio
import json

import pytest

from tests.sim.replay.recorded import record
from tests.system.bench import bench
from wallride import cli
from wallride.clients.parameters import SAVED_WITHIN_S, ask
from wallride.clients.race_along import race_along
from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.arbitration.emergency_stop import Cause
from wallride.runtime.line_files import read_course, read_line
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.restarting import ProcessRestart
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.wire import zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

FILE = "[battery]\nsettle_s = 0\n\n[car]\nmax_speed_mps = 6.0\n\n[wall_follow]\nspeed_mps = 1.5\n"
ASKED_MPS = 5.0
RACED_S = 36.0


class CarToEnd(Car):
    """A car that holds what ends its drive."""

    stop: asyncio.Event


class Garage:
    """Starts a car by its file, again and again; before each start it is put where the lap began."""

    def __init__(self, file):
        self.file = file
        self.restart = ProcessRestart(file, None, ())

    async def drive(self, plan):
        """Start the car and follow a plan of it, which may end it; return the car at its end."""
        settings = load_settings(self.file)
        around = CarSurroundings(restart=self.restart, course=read_course(settings.map, settings.car))
        clock = asyncio.get_running_loop().time
        self.twin = TwinWorld(load_world("loop", side="left", seed=0), clock)
        motor = WorldMotor(self.twin, clock)
        car = CarToEnd(settings, WorldLidar(self.twin, clock), motor, MemoryBus(clock), clock, around)
        car.stop = asyncio.Event()
        self.restart.end = car.stop.set
        driving = asyncio.create_task(car.drive(car.stop))
        try:
            await plan(car)
        except BaseException:
            car.stop.set()
            raise
        finally:
            await driving
        return car


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A map of one lap of the loop, with its line."""
    folder = tmp_path_factory.mktemp("lap")
    record(folder / "lap.mcap", seconds=16.0, sections={"wall_follow": {"speed_mps": 4.0}})
    target = folder / "lab.yaml"
    assert cli.main(["map", str(folder / "lap.mcap"), "-o", str(target)]) == 0
    assert cli.main(["line", str(target), "-o", str(folder / "lab.line.csv")]) == 0
    return target


async def in_the_loop(function, *arguments):
    """Stand in for `asyncio.to_thread`: virtual time does not wait for threads."""
    return function(*arguments)


def test_a_running_car_goes_on_to_race_along_the_line_of_its_lap(tmp_path, made, monkeypatch):
    monkeypatch.setattr(asyncio, "to_thread", in_the_loop)
    file = tmp_path / "car.toml"
    file.write_text(FILE)
    line_mps = float(read_line(made.with_name("lab.line.csv"), made).speed_mps.max())
    figures = {}

    async def race(car):
        async def asked(question):
            try:
                return json.loads(await car.restart.receive(json.dumps(question).encode()))
            except UnacceptableError as error:
                raise RefusedError(str(error)) from None

        return await race_along(file, made, line_mps, ASKED_MPS, asked)

    async def follows_the_wall(car):
        car.permit.grant(until_s=car.clock() + 4.0)
        await asyncio.sleep(3.0)
        assert car.motor.state.speed_mps > 1.0
        with pytest.raises(RefusedError, match=r"^no restart: only while the car stands; stop it first$"):
            await race(car)
        await asyncio.sleep(3.0)
        car.emergency_stop.latch(Cause.OPERATOR, "pressed")
        with pytest.raises(RefusedError, match=r"^no restart: the e-stop is on"):
            await race(car)
        assert file.read_text() == FILE
        car.emergency_stop.clear(Cause.OPERATOR)
        assert "The car starts anew, disarmed." in (await race(car))[1]

    async def follows_the_line(car):
        await asyncio.sleep(3.0)
        assert car.motor.state.speed_mps == 0.0, "a fresh permit is needed"
        car.permit.grant(until_s=car.clock() + RACED_S)
        await asyncio.sleep(RACED_S - 1.0)
        figures.update(car.laws.race)
        car.stop.set()

    async def main():
        garage = Garage(file)
        await garage.drive(follows_the_wall)
        await garage.drive(follows_the_line)

        assert garage.twin.contact_mps is None

    run_virtual(main())
    assert figures["laps"] >= 2
    assert figures["speed_share"] == 1.0, "built up from lap to lap"
    assert figures["best_s"] == figures["time_s"], "the last lap is the fastest"


async def test_a_process_starts_itself_anew_in_its_place(tmp_path):
    endpoint = free_endpoint()
    listens = (f'telemetry.listen=["{endpoint}"]', "telemetry.enabled=true", "operator.permit=required")
    async with bench(tmp_path, *listens) as car:
        await car.until(lambda: any("motor ready" in line for line in car.runtime.log), "the start", 50.0)
        bus = Bus(zenoh_config.client_config(endpoint, None))
        await bus.open()
        try:
            assert await ask(bus, "sim", "restart", SAVED_WITHIN_S) == {"restarts": True}
        finally:
            await bus.close()
        await car.until(
            lambda: sum("motor ready" in line for line in car.runtime.log) == 2, "a second start of the process", 50.0
        )
        assert car.runtime.exit_code is None
