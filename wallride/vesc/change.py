"""One change of a VESC's application configuration: look, say, ask, keep a copy, write while it stands, read back."""

import asyncio
import json
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from wallride.doctor.motor_config import BY_TOOL_SERVO, BY_TOOL_TIMEOUT
from wallride.drivers.address import Address
from wallride.drivers.api import LinkLost
from wallride.drivers.vesc.app_config import (
    RECOMMENDED_BRAKE_A,
    RECOMMENDED_TIMEOUT_S,
    AppConfig,
    change_app_config,
    decode_app_config,
    layout_of,
    unlike_places,
)
from wallride.drivers.vesc.replies import HARDWARE_VESC, STATUS_TIMED_OUT, Firmware, Values
from wallride.drivers.vesc.settings_link import VescSettingsLink

NOT_AS_WANTED: Final = 3
"""Exit code: something was written, and what is in the controller now is not what was asked for, or unknown."""
BY_TOOL: Final = f"in {BY_TOOL_TIMEOUT}, and {BY_TOOL_SERVO.partition(': ')[2]}"
REOPENED_TIMES: Final = 25
REOPEN_EVERY_S: Final = 0.2
AFTERWARDS: Final = "now switch the VESC off and on, and see that it kept them:  wallride doctor --only motor"
OBSERVED_S: Final = 0.5
ASK_EVERY_S: Final = 0.02
SPARE_S: Final = 1.5
MAX_SHOWN_TIMEOUT_S: Final = 3.0
"""A longer command timeout, or none, is not waited for."""
STANDING_ERPM: Final = 300
"""Under it a VESC's speed is noise."""
STANDING_STEPS: Final = 1
IDLE_DUTY: Final = 0.005


class VescChangeError(Exception):
    """Nothing was changed; the text is one line with the remedy."""


@dataclass(frozen=True, slots=True)
class Backup:
    """uuid: of the controller, in hexadecimal digits. configuration: from its signature on."""

    firmware: str
    hardware: str
    uuid: str
    configuration: bytes


def backup_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of backups: in the user's folder of states."""
    return Path(environment.get("XDG_STATE_HOME") or "~/.local/state").expanduser() / "wallride" / "vesc"


def save(backup: Backup, folder: Path) -> Path:
    """Write a backup to the disk, under a name of its own; OSError where it cannot be."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = f"{backup.uuid[-8:] or 'vesc'}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}"
    text = {**asdict(backup), "configuration": backup.configuration.hex()}
    for number in range(1, 1000):
        path = folder / f"{stem}{'' if number == 1 else f'-{number}'}.json"
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(json.dumps(text, indent=1) + "\n")
                file.flush()
                os.fsync(file.fileno())  # before the controller is changed
        except FileExistsError:
            continue
        return path
    raise FileExistsError(17, "too many backups of one second", str(folder))


def load(path: Path) -> Backup:
    """Read a backup; VescChangeError for another file."""
    try:
        text = json.loads(path.read_text(encoding="utf-8"))
        return Backup(text["firmware"], text["hardware"], text["uuid"], bytes.fromhex(text["configuration"]))
    except OSError as error:
        raise VescChangeError(f"{path}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise VescChangeError(f"{path}: is no copy of `wallride vesc set`; they are in {backup_folder()}") from None


@dataclass(frozen=True, slots=True)
class SettingsWish:
    """What to set; None: stays as it is. recommended: a firmware without servo output is no error."""

    timeout_s: float | None = None
    timeout_brake_a: float | None = None
    servo_output: bool | None = None
    recommended: bool = False


@dataclass(frozen=True, slots=True)
class VescAccess:
    """How a change meets its user. agreed: asks for consent once the change was said."""

    address: Address
    folder: Path
    say: Callable[[str], None]
    agreed: Callable[[], bool]


@dataclass(frozen=True, slots=True)
class VescContents:
    """What was found in a controller."""

    firmware: Firmware
    configuration: bytes
    config: AppConfig

    @property
    def uuid(self) -> str:
        """Return the controller's own number in hexadecimal digits."""
        return self.firmware.uuid.hex()


async def set_values(access: VescAccess, wish: SettingsWish) -> int:
    """Set what is wished; return the exit code. VescChangeError: nothing was changed."""

    def wanted(found: VescContents) -> bytes:
        config, servo = found.config, wish.servo_output
        if servo is not None and config.servo_output is None:
            if not wish.recommended:
                raise VescChangeError(
                    f"firmware {found.firmware.version} has no setting for the servo output: it needs 5.03 or later,"
                    " or a build with servo output"
                )
            access.say("servo output: this firmware has no setting for it; see the wheels steer in `wallride teleop`")
            servo = None
        timeout_s = config.timeout_s if wish.timeout_s is None else wish.timeout_s
        brake_a = config.timeout_brake_a if wish.timeout_brake_a is None else wish.timeout_brake_a
        return change_app_config(found.configuration, timeout_s=timeout_s, timeout_brake_a=brake_a, servo_output=servo)

    return await _change(access, wanted)


async def restore(access: VescAccess, file: Path) -> int:
    """Write a backup into the controller that it is of; as set_values."""
    kept = load(file)

    def wanted(found: VescContents) -> bytes:
        if kept.uuid != found.uuid:
            raise VescChangeError(f"{file}: is of another VESC ({kept.uuid or 'unnamed'}, this is {found.uuid})")
        if kept.configuration[:4] != found.configuration[:4] or layout_of(kept.configuration) is None:
            raise VescChangeError(
                f"{file}: is of firmware {kept.firmware}, whose layout is another than that of"
                f" {found.firmware.version}: set the values with  wallride vesc set"
            )
        config = decode_app_config(kept.configuration)
        if config is not None and config.timeout_s == 0:
            raise VescChangeError(
                f"{file}: has no command timeout: the car keeps its speed when this computer hangs; it is not written"
                " back: set the values with  wallride vesc set"
            )
        return kept.configuration

    return await _change(access, wanted)


async def _change(access: VescAccess, wanted: Callable[[VescContents], bytes]) -> int:
    try:
        link = await VescSettingsLink.open(access.address)
    except LinkLost as error:
        raise VescChangeError(str(error)) from None
    try:
        found = await _contents(link, access.address)
        new = wanted(found)
        if not unlike_places(new, found.configuration):
            access.say(f"firmware {found.firmware.version}: it is set so already; nothing to do")
            return 0
        for line in describe(found, new):
            access.say(line)
        if not access.agreed():
            return 0
        await _check_idle(link, found)
        kept = _keep(access, found)
    except LinkLost as error:
        link.close()
        raise VescChangeError(f"{error}; nothing was changed") from None
    except BaseException:
        link.close()
        raise
    confirmed, now = await _write(link, access.address, new)
    return _judge(access, found, new, VescOutcome(kept, confirmed, now, link.said))


async def _contents(link: VescSettingsLink, address: Address) -> VescContents:
    firmware = await link.firmware()
    if firmware is None or (firmware.hardware_kind or HARDWARE_VESC) != HARDWARE_VESC:
        raise VescChangeError(f"{address}: no VESC answers there: is its battery on, is it the right port?")
    configuration = await link.app_config()
    config = None if configuration is None else decode_app_config(configuration)
    if configuration is None or config is None or layout_of(configuration) is None:
        raise VescChangeError(
            f"firmware {firmware.version}: the layout of its configuration is not known here to the last byte, so"
            f" nothing is written; set it {BY_TOOL}"
        )
    return VescContents(firmware, configuration, config)


def describe(found: VescContents, new: bytes) -> list[str]:
    """Return a line for each value that will change, and one for other bytes."""
    after = decode_app_config(new)
    if after is None:  # not reached: the layout is that of what was found
        raise VescChangeError("the new configuration cannot be read")
    lines = [f"VESC {found.firmware.hardware}, firmware {found.firmware.version}:"]
    for name, before, then in (
        ("timeout", f"{found.config.timeout_s * 1000:.0f} ms", f"{after.timeout_s * 1000:.0f} ms"),
        ("timeout brake current", f"{found.config.timeout_brake_a:g} A", f"{after.timeout_brake_a:g} A"),
        ("servo output", _on(found.config.servo_output), _on(after.servo_output)),
        ("application", str(found.config.application), str(after.application)),
    ):
        lines.append(f"  {name:22} {before}{f'  ->  {then}' if then != before else ', stays'}")
    named = change_app_config(
        found.configuration, timeout_s=after.timeout_s, timeout_brake_a=after.timeout_brake_a,
        servo_output=after.servo_output,
    )  # fmt: skip
    if others := len(unlike_places(new, named)):
        lines.append(f"  and {others} other bytes, as in the file")
    if not after.timeout_brake_a:
        lines.append("  WITHOUT a brake current the car rolls on when its computer falls silent")
    if after.servo_output and not found.config.servo_output:
        lines.append("  the front wheels may jump to the servo's middle: keep your hands off")
    return lines


def _on(value: bool | None) -> str:  # noqa: FBT001 - a value that is shown
    return "not in this firmware" if value is None else "on" if value else "off"


async def _check_idle(link: VescSettingsLink, found: VescContents) -> None:
    why = await why_not_idle(link, found.config.timeout_s)
    if why:
        raise VescChangeError(f"{why}; nothing was changed")
    if await link.app_config() != found.configuration:
        raise VescChangeError("its configuration has changed meanwhile; nothing was changed: try again")


def _keep(access: VescAccess, found: VescContents) -> Path:
    try:
        firmware = found.firmware
        kept = save(Backup(firmware.version, firmware.hardware, found.uuid, found.configuration), access.folder)
    except OSError as error:
        raise VescChangeError(
            f"{error.filename or access.folder}: {error.strerror}: without a copy of what is there nothing is changed"
        ) from None
    access.say(f"what was there: {kept}")
    return kept


async def _write(link: VescSettingsLink, address: Address, new: bytes) -> tuple[bool, bytes | None]:
    """Write and read back, over a lost cable, too; return whether it confirmed, and what is there now."""
    confirmed, lost = False, False
    try:
        confirmed = await link.write_app_config(new)
        now = await link.app_config()
    except LinkLost:
        lost, now = True, None
    finally:
        link.close()
    for _ in range(REOPENED_TIMES if lost else 0):
        await asyncio.sleep(REOPEN_EVERY_S)
        try:
            again = await VescSettingsLink.open(address)
        except LinkLost:
            continue
        try:
            now = await again.app_config()
        except LinkLost:
            continue
        finally:
            again.close()
        break
    return confirmed, now


@dataclass(frozen=True, slots=True)
class VescOutcome:
    """What came of a write. now: the configuration that was read back, None without an answer."""

    kept: Path
    confirmed: bool
    now: bytes | None
    said: list[str]


def _judge(access: VescAccess, found: VescContents, new: bytes, outcome: VescOutcome) -> int:
    undo = f"wallride vesc restore {outcome.kept}"
    if outcome.now is None:
        access.say(
            "the VESC does not answer after the write: it has the values before or the new ones. Switch it off and on,"
            f" see  wallride doctor --only motor ; back:  {undo}"
        )
        return NOT_AS_WANTED
    unlike = unlike_places(new, outcome.now)
    if not unlike and outcome.confirmed:
        rounded = sum(one != other for one, other in zip(new, outcome.now, strict=True))
        access.say(
            f"written, and read back: {len(new)} bytes as wanted"
            f"{f', {rounded} of them by the rounding of its firmware' if rounded else ''}; back:  {undo}"
        )
        access.say(AFTERWARDS)
        return 0
    if outcome.now == found.configuration:
        words = f" (it says: {'; '.join(outcome.said)})" if outcome.said else ""
        raise VescChangeError(f"the VESC did not take it{words}; nothing was changed: set it {BY_TOOL}")
    if not unlike:
        access.say(f"read back as wanted, but the VESC did not confirm that it stored it; back:  {undo}")
        access.say(AFTERWARDS)
        return NOT_AS_WANTED
    access.say(f"read back, {len(unlike)} bytes are not as wanted (first at {unlike[0]}): do not drive; back:  {undo}")
    return NOT_AS_WANTED


def recommended() -> SettingsWish:
    """Return what protects a car."""
    return SettingsWish(RECOMMENDED_TIMEOUT_S, RECOMMENDED_BRAKE_A, servo_output=True, recommended=True)


async def why_not_idle(link: VescSettingsLink, timeout_s: float) -> str:
    """Return why the controller must not be written now; "" where it stood, uncommanded, for half a second.

    timeout_s: its command timeout: where its firmware reports it, it must have passed. LinkLost as of the link.
    """
    waited = 0 < timeout_s <= MAX_SHOWN_TIMEOUT_S
    clock = asyncio.get_running_loop().time
    now_s = clock()
    give_up_s = now_s + OBSERVED_S + SPARE_S + (timeout_s if waited else 0.0)
    idle_since_s, first, last_why = now_s, None, ""
    while (now_s := clock()) < give_up_s:
        values = await link.values()
        if values is None:
            return "the VESC does not tell its speed"
        why = _why_busy(values, first, needs_timeout=waited)
        if why:
            idle_since_s, first, last_why = clock(), None, why
        elif first is None:
            idle_since_s, first = clock(), values
        elif now_s - idle_since_s >= OBSERVED_S:
            return ""
        await asyncio.sleep(ASK_EVERY_S)
    return last_why or "the VESC answers too slowly"


def _why_busy(values: Values, first: Values | None, *, needs_timeout: bool) -> str:
    turned = first is not None and abs(values.tachometer - first.tachometer) > STANDING_STEPS
    if abs(values.erpm) >= STANDING_ERPM or turned:
        return f"the wheels turn ({values.erpm} ERPM): let the car stand"
    commanded = needs_timeout and values.status is not None and not values.status & STATUS_TIMED_OUT
    if commanded or abs(values.duty) > IDLE_DUTY:
        return "a program commands the motor: end it (wallride, VESC Tool, a remote control)"
    return ""
