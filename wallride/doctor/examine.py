"""Runs the checks in the order in which a car is set up: settings, computer, ports, devices, access."""

from collections.abc import AsyncIterator, Callable, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from wallride.doctor import GROUPS
from wallride.doctor.access import Holder, check_access
from wallride.doctor.computer import Computer
from wallride.doctor.condition import check_condition
from wallride.doctor.findings import Finding, Level, fail, ok, warn
from wallride.doctor.joystick import check_joystick
from wallride.doctor.lidar import judge_lidar, look_at_lidar, remedy_of, scans_from_elsewhere
from wallride.doctor.motor import CALIBRATE, judge_motor, judge_pulses, look_at_motor
from wallride.doctor.motor_config import judge_app_config, read_app_config
from wallride.doctor.network import check_network
from wallride.doctor.places import colliding_places
from wallride.doctor.ports import check_ports, running_car
from wallride.doctor.program import check_program
from wallride.doctor.wheels_up import Ask, measure_wheels_up
from wallride.drivers.api import DriverError
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.found_lidar import look_for
from wallride.runtime.settings.devices import TopicLidarSettings
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings
from wallride.runtime.wire.port_holder import holder_of

ACTIVE: Final = "/run/systemd/units/invocation:wallride.service"
"""A link that systemd keeps while the unit is active."""
STOP_FIRST: Final = "sudo systemctl stop wallride, then look again; sudo systemctl start wallride afterwards"
DEVICES: Final = frozenset({"ports", "lidar", "motor"})
PARTS: Final = frozenset({"lidar", "motor"})
"""Devices with a section of the settings."""


def find_settings(
    config: Path | None, assignments: Sequence[str], groups: Sequence[str] = GROUPS
) -> tuple[Settings, frozenset[str], Finding]:
    """Return the settings, the devices whose settings are wrong, and what is to be said of them.

    A wrong section has the defaults in its place. Own laws and drivers are imported where these groups look at them.
    """
    where = str(config) if config is not None else "no file: the defaults"
    try:
        settings = load_settings(config, assignments, laws="program" in groups, drivers=bool(DEVICES & set(groups)))
        if found := colliding_places(settings, [config]):
            finding = fail("settings", "; ".join(found), "correct the file: the car does not start with it")
            return settings, frozenset(), finding
        return settings, frozenset(), ok("settings", where)
    except SettingsError as error:
        settings, wrong = _usable(error)
        return settings, wrong, fail("settings", str(error), "correct them; until then the rest is looked at")


def _usable(error: SettingsError) -> tuple[Settings, frozenset[str]]:
    """Return the settings without the wrong sections, and the devices that are not in them."""
    if error.wrong:
        with suppress(ValidationError):  # sections that are wrong together
            settings, wrong = Settings.model_validate(error.right), error.wrong & PARTS
            searched = isinstance(settings.lidar, AutoLidarSettings)  # on every port but the motor's
            return settings, PARTS if searched and wrong else wrong
    return Settings(), PARTS


async def examine(
    computer: Computer, settings: Settings, groups: Sequence[str] = GROUPS, *, wheels_up: Ask | None = None,
    holder: Holder = holder_of, wrong: Set[str] = frozenset(),
) -> AsyncIterator[Finding]:  # fmt: skip
    """Yield the findings of these groups as they come.

    wheels_up: turns the wheels, and asks; None: nothing moves. wrong: devices that are not known, by `find_settings`.
    """
    ports: list[Finding] = []
    if DEVICES & set(groups):
        if computer.path(ACTIVE).is_symlink():
            groups = [group for group in groups if group not in DEVICES]
            yield warn("devices", "the car's service runs and has them: they are not looked at", STOP_FIRST)
        elif (pid := running_car(computer, settings)) is not None:
            groups = [group for group in groups if group not in DEVICES]
            words = f"the car runs and has them (wallride run, process {pid}): they are not looked at"
            yield warn("devices", words, f"end it, then look again: Ctrl-C in its terminal, or kill {pid}")
        else:
            ports = [one for one in check_ports(computer, settings) if one.subject.removesuffix(" port") not in wrong]
    unusable = {finding.subject for finding in ports if finding.level is Level.FAIL}

    def blamed(port: str) -> list[Finding]:
        return [] if "ports" in groups else [finding for finding in ports if finding.subject == port]

    async def access() -> AsyncIterator[Finding]:
        for finding in await check_access(computer, settings, holder):
            yield finding

    steps: dict[str, AsyncIterator[Finding]] = {
        "program": _each(lambda: check_program(computer, settings)),
        "computer": _each(lambda: check_condition(computer, settings)),
        "ports": _each(lambda: ports),
        "lidar": _each(lambda: blamed("lidar port")) if "lidar port" in unusable else _lidar(computer, settings),
        "motor": _each(lambda: blamed("motor port")) if "motor port" in unusable else _motor(settings, wheels_up),
        "access": access(),
        "joystick": _each(lambda: check_joystick(computer)),
    }
    steps |= {device: _each(partial(_unknown, device)) for device in wrong}
    for group in GROUPS:
        if group in groups:
            async for finding in steps[group]:
                yield finding


def _unknown(device: str) -> list[Finding]:
    return [warn(device, "not looked at: its settings are wrong", "correct them first, then look again")]


async def _each(check: Callable[[], list[Finding]]) -> AsyncIterator[Finding]:
    for finding in check():
        yield finding


async def _lidar(computer: Computer, settings: Settings) -> AsyncIterator[Finding]:
    if isinstance(settings.lidar, TopicLidarSettings):
        yield scans_from_elsewhere(settings.lidar)
        return
    if isinstance(settings.lidar, AutoLidarSettings):
        try:
            found = await look_for(settings.lidar, settings.motor)
        except DriverError as error:
            yield fail("lidar", str(error), remedy_of(str(error)))
            return
        yield ok("lidar kind", f"{found.settings.driver} at {found.place}; wallride run writes it down")
        settings = settings.model_copy(update={"lidar": found.settings})
    report = await look_at_lidar(settings.lidar)
    for finding in check_network(computer, settings):
        answers = report.scans and finding.level is Level.FAIL
        yield replace(finding, level=Level.WARN) if answers else finding
    for finding in judge_lidar(report):
        yield finding


async def _motor(settings: Settings, wheels_up: Ask | None) -> AsyncIterator[Finding]:
    report = await look_at_motor(settings.motor)
    for finding in judge_motor(report, settings.battery):
        yield finding
    if report.state is not None and isinstance(settings.motor, PwmSettings):
        yield judge_pulses(settings.motor)
        if wheels_up is not None:
            yield warn("wheels up", "not turned: this measures a VESC", CALIBRATE)
    if report.state is None or not isinstance(settings.motor, VescSettings):
        return
    for finding in judge_app_config(await read_app_config(settings.motor)):
        yield finding
    if wheels_up is not None and not report.state.fault and not report.state.killed:
        for finding in await measure_wheels_up(settings.motor, wheels_up):
            yield finding
