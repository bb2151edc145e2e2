"""`wallride sim --cars N`: several runtimes, each with emulated devices of its own, in one world."""

import argparse
import asyncio
import json
import math
from collections.abc import Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wallride.runtime.host.output_files import write_answer
from wallride.runtime.host.terminal_text import complain
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.figures.summary import device_faults
from wallride.sim.live.record import Record
from wallride.sim.live.runtime_process import WallrideProcess
from wallride.sim.live.scenes import WorldScene
from wallride.sim.live.screen import port_notice
from wallride.sim.live.session import RuntimeStart, SessionError, SimulatorSession, innermost
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.live.traffic import TrafficWorld, starts
from wallride.sim.live.user_code import UserCode
from wallride.sim.scenario.conditions import Conditions
from wallride.sim.scenario.simulated_car import saved_settings
from wallride.sim.world.place import World

LOOK_EVERY_S = 0.1
FIRST_CAR = "car1"


@dataclass(frozen=True, slots=True)
class SimulatedCar:
    """One car of a fleet. session: runs it, and has its record."""

    name: str
    scene: WorldScene
    session: SimulatorSession

    @property
    def record(self) -> Record:
        """Return the record of its drive."""
        return self.session.record


def build_fleet(
    world: World, count: int, conditions: Conditions, settings: Settings, seed: int, *, put_back: bool
) -> list[SimulatedCar]:
    """Return the cars car1 to carN at their starts; ValueError when the world has no place for them."""
    vehicles = [Vehicle(conditions.vehicle, pose) for pose in starts(world, count, settings)]
    all_ready, side, things = asyncio.Barrier(count), settings.wall_follow.side, conditions.things()
    cars = []
    for k, vehicle in enumerate(vehicles):
        own_world = replace(world, start=vehicle.pose)
        scene = WorldScene(own_world, side, conditions.lidar, None, seed + k, things)
        scene.back_to = vehicle.pose if put_back else None
        scene.surroundings = TrafficWorld(own_world, things, [other for other in vehicles if other is not vehicle])
        wiring = conditions.wiring.wired(settings.motor)
        session = SimulatorSession(
            scene, vehicle, wiring, desired_m=settings.wall_follow.desired_distance_m, user_code=UserCode.of(settings)
        ).fit(settings.motor)
        session.join(all_ready.wait)
        cars.append(SimulatedCar(f"car{k + 1}", scene, session))
    return cars


async def run_fleet(
    cars: list[SimulatedCar], options: argparse.Namespace, config: Path, settings: Settings, stop: StopRequest,
    console: Console,
) -> None:  # fmt: skip
    """Drive all cars until the time or `stop` ends it; when one of them fails, all end, with its SessionError."""
    duration_s = options.duration or 60.0
    async with asyncio.TaskGroup() as tasks:
        drives = [
            tasks.create_task(_drive(car, start_of(options, config, car, settings), duration_s, stop)) for car in cars
        ]
        page = tasks.create_task(_tell(cars, console, with_page=not options.headless))
        await asyncio.wait(drives)
        page.cancel()


async def _drive(car: SimulatedCar, start: RuntimeStart, duration_s: float, stop: StopRequest) -> None:
    """Drive one car; its SessionError names it."""
    failure: SessionError | None = None
    try:
        await car.session.run(start, duration_s, stop, lambda _record: None)
    except* SessionError as group:
        failure = innermost(group)
    if failure is not None:
        raise SessionError(f"{car.name}: {failure}", failure.exit_code)


def fleet_summary(cars: list[SimulatedCar], world: str, failed: str = "") -> dict[str, Any]:
    """Return the figures of each car. failed: why the runtime of one did not end in order."""
    return {"world": world, "failed": failed, "cars": {car.name: _figures(car) for car in cars}}


def write_fleet(summary: dict[str, Any], target: str | None, code: UserCode, console: Console) -> int:
    """Write the summary; return the exit code, 1 when a car failed, touched something, was not heard, or `code` failed.

    code: the user's laws and drivers.
    """
    if target != "-":
        console.print(_table(summary))
    write_answer(json.dumps(summary, indent=2) + "\n", target)
    if summary["failed"]:
        return complain(summary["failed"], 1)
    failed = {name: code.faults(car["faults"] or ()) for name, car in summary["cars"].items()}
    for name, faults in failed.items():
        if faults:
            complain(f"{name}: {'; '.join(faults)}")
    if any(failed.values()):
        return 1
    return 1 if any(car["contacts"] or car["telemetry"] for car in summary["cars"].values()) else 0


def start_of(options: argparse.Namespace, config: Path, car: SimulatedCar, settings: Settings) -> RuntimeStart:
    """Return the start of a car's runtime. The first car has the standard port where it is free, the others none."""
    is_first = car.name == FIRST_CAR
    elsewhere = [] if is_first else [f"telemetry.listen={free_endpoint()}"]
    chosen = [
        *elsewhere,
        "telemetry.any_port=true", "recording.simulated=true", f"car.name={car.name}",
        f"recording.world={json.dumps(car.scene.world.name)}",
    ]  # fmt: skip
    return RuntimeStart(
        config,
        [*options.assignments, *chosen],
        ["--saved", str(saved_settings(config))],
        settings.telemetry.listen if is_first else (),
    )


async def _tell(cars: list[SimulatedCar], console: Console, *, with_page: bool) -> None:
    """Say once where the cars are, and serve one page for all of them."""
    await _until(lambda: all(car.record.address for car in cars))
    addresses = [car.record.address for car in cars if car.record.address is not None]
    places = ",".join(address.endpoint for address in addresses if address.endpoint)
    first = cars[0].record
    if notice := port_notice(first.address, first.listen):
        console.print(f"{FIRST_CAR}: {notice}", soft_wrap=True)
    console.print(f"[dim]{len(cars)} cars: export WALLRIDE_CONNECT={places}[/dim]", soft_wrap=True)
    console.print("[dim]then: wallride cars --watch, wallride stop --all, wallride teleop --car car1[/dim]")
    if not with_page:
        return
    async with AsyncExitStack() as stack:
        monitor = WallrideProcess(["monitor", "--connect", places])
        await monitor.start()
        stack.push_async_callback(monitor.stop)
        await _until(lambda: any("http://" in line for line in monitor.log))
        console.print(f"[dim]{next(line for line in monitor.log if 'http://' in line)}[/dim]", soft_wrap=True)
        await asyncio.Event().wait()


async def _until(condition: Callable[[], bool]) -> None:
    while not condition():  # noqa: ASYNC110 - what other processes print has no event
        await asyncio.sleep(LOOK_EVERY_S)


def _figures(car: SimulatedCar) -> dict[str, Any]:
    record = car.record
    status = record.telemetry.get("status")
    return {
        **record.sums.figures(),
        "contacts": car.scene.contacts,
        "laps": len(car.scene.lap_times_s),
        "lap_times_s": car.scene.lap_times_s,
        "scan_to_motor_ms": record.latency.summary_ms(),
        "cpu_share": round(record.cpu_s / record.time_s, 3) if record.time_s and math.isfinite(record.cpu_s) else None,
        "telemetry": "" if status else record.unheard,
        "faults": device_faults(status) | dict(record.own_faults) if status else None,
    }


def _table(summary: dict[str, Any]) -> Table:
    columns = {
        "error [cm]": ("mean_abs_error_m", 100, ".2f"), "speed [m/s]": ("mean_speed_mps", 1, ".2f"),
        "distance [m]": ("distance_m", 1, ".1f"), "clearance [m]": ("min_clearance_m", 1, ".2f"),
        "contacts": ("contacts", 1, ".0f"), "laps": ("laps", 1, ".0f"), "CPU [cores]": ("cpu_share", 1, ".2f"),
    }  # fmt: skip
    table = Table(title=f"wallride sim: {len(summary['cars'])} cars in {summary['world']}")
    for name in ("car", *columns):
        table.add_column(escape(name))
    for name, car in summary["cars"].items():
        table.add_row(name, *(_shown(car[key], scale, form) for key, scale, form in columns.values()))
    return table


def _shown(value: float | None, scale: float, form: str) -> str:
    return "-" if value is None else format(value * scale, form)
