"""`wallride emulate`: the emulated devices, and a settings file with which a car uses them."""

import argparse
import asyncio
import math
import os
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import tomlkit
from rich.console import Console

from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.host.output_files import write_file
from wallride.runtime.host.terminal_text import complain
from wallride.runtime.own_drivers.settings import OwnMotorSettings
from wallride.runtime.settings.devices import DEFAULT_DRIVERS
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings
from wallride.sim.devices import lidar_kinds
from wallride.sim.live.asked_scene import SimUsageError, build_scene
from wallride.sim.live.emulated_car import DeviceAddresses, EmulatedCar, EmulatedPorts
from wallride.sim.live.session import SessionError
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.scenario.conditions import ConditionsError
from wallride.sim.scenario.simulated_car import find_config

CAR_CONFIG: Final = "config/car.toml"
FOLDER: Final = "wallride/emulated"
SETTINGS: Final = "car.toml"
WRITTEN: Final = frozenset({"lidar.driver", "lidar.model", "motor.driver"})
"""Settings of the devices that the settings file of the emulated car gets, beside their addresses."""
EMULATED_LIDARS: Final = ("hokuyo", "rplidar", "ydlidar")


def emulate(options: argparse.Namespace, stop: StopRequest) -> int:
    """Keep the emulated car running; 0 at its end, 2 for a wrong option or a taken port."""
    console = Console(stderr=True)
    folder = (options.folder or emulated_folder()).resolve()  # an address needs a whole path
    file = folder / SETTINGS
    try:
        _check(options)
        settings = load_settings(
            find_config(CAR_CONFIG), options.assignments
        )  # the car as it is, whatever the user enters
        conditions, scene, vehicle = build_scene(options, settings)
        _check_devices(settings)
        scene.turning = lidar_kinds.emulated(lidar_kinds.word_of(settings.lidar))
        ports = EmulatedPorts(
            folder, None if options.lidar == "serial" else options.port, options.lidar != "tcp",
            options.vesc_timeout, options.vesc_brake,
        )  # fmt: skip
        car = EmulatedCar(scene, vehicle, conditions.wiring.wired(settings.motor), ports, motor=settings.motor)
        car.tell_held_up = lambda words: console.print(words, soft_wrap=True)

        def tell(addresses: DeviceAddresses) -> None:
            write_settings(file, addresses, settings)
            _show(console, file, scene.world.name, addresses, options.config_variable)
            if said := [name for text in options.assignments if (name := text.partition("=")[0]) not in WRITTEN]:
                console.print(f"{', '.join(said)}: of the emulated car alone; that file has its own", soft_wrap=True)
            _tell_programs(addresses, settings)

        asyncio.run(car.keep(options.duration or math.inf, stop, tell))
    except (SettingsError, ConditionsError, SimUsageError, SessionError, tomlkit.exceptions.TOMLKitError) as error:
        return complain(error)
    return 0


def emulated_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of the emulated car: the same at every start."""
    return Path(environment.get("XDG_STATE_HOME") or "~/.local/state").expanduser() / FOLDER


def write_settings(file: Path, addresses: DeviceAddresses, settings: Settings | None = None) -> None:
    """Write devices and addresses into the emulated car's settings; a new file has the contents of config/car.toml.

    A section of another device than that of `settings` is written anew, because none of its values is this one's.
    """
    settings = settings or Settings()
    is_new = not file.is_file()
    document = tomlkit.parse((find_config(CAR_CONFIG) if is_new else file).read_text(encoding="utf-8"))
    changes: dict[str, dict[str, object]] = {
        "lidar": {"driver": settings.lidar.driver, "address": addresses.lidar},
        "motor": {"driver": settings.motor.driver, addresses.motor_key: addresses.motor},
    }
    if isinstance(settings.lidar, YdlidarSettings) and settings.lidar.model != "auto":
        changes["lidar"]["model"] = settings.lidar.model
    if is_new:
        changes |= {"car": {"name": "emulated"}, "recording": {"simulated": True}}
    for section, values in changes.items():
        table = document.setdefault(section, tomlkit.table())
        if table.get("driver", DEFAULT_DRIVERS.get(section)) != values.get("driver"):
            table = document[section] = tomlkit.table()
        for key, value in values.items():
            if table.get(key) != value:
                table[key] = value
    text = tomlkit.dumps(document)
    if is_new or text != file.read_text(encoding="utf-8"):
        write_file(file, text)


def _show(console: Console, file: Path, world: str, addresses: DeviceAddresses, variable: str) -> None:
    shown = " and ".join(addresses.lidars)
    console.print(
        f"an emulated car in {world}: lidar at {shown}, motor controller at {addresses.motor}", soft_wrap=True
    )
    console.print(f"its settings, yours to edit: {file}", soft_wrap=True)
    console.print("In each other terminal first, so that every command means this car:")
    console.print(f"  export {variable}={shlex.quote(str(file))}", soft_wrap=True)
    console.print("then, for example:")
    for command in ("doctor", "run", "teleop"):
        console.print(f"  wallride {command}")
    console.print("Ctrl-C ends it")


def _tell_programs(addresses: DeviceAddresses, settings: Settings) -> None:
    """Write the settings that differ from a car's as options of a command."""
    chosen = [*lidar_kinds.assignments(lidar_kinds.word_of(settings.lidar)), f"motor.driver={settings.motor.driver}"]
    usual = {f"{section}.driver={driver}" for section, driver in DEFAULT_DRIVERS.items()}
    places = [f"lidar.address={addresses.lidar}", f"motor.{addresses.motor_key}={addresses.motor}"]
    sys.stdout.write("".join(f"--set {one}\n" for one in (*chosen, *places) if one not in usual))
    sys.stdout.flush()


def _check_devices(settings: Settings) -> None:
    if settings.lidar.driver not in EMULATED_LIDARS or isinstance(settings.motor, OwnMotorSettings):
        raise SimUsageError(
            f"lidar.driver = {settings.lidar.driver}, motor.driver = {settings.motor.driver}: emulated are the lidars"
            f" {', '.join(EMULATED_LIDARS)}, and the built-in motors"
        )


def _check(options: argparse.Namespace) -> None:
    for name, value in (("--duration", options.duration), ("--vesc-timeout", options.vesc_timeout)):
        if value is not None and not 0 < value < math.inf:
            raise SimUsageError(f"{name} {value:g}: give a finite number of seconds above 0")
    if not 0 <= options.vesc_brake <= 100:
        raise SimUsageError(f"--vesc-brake {options.vesc_brake:g}: give amperes from 0 to 100")
