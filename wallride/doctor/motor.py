"""The motor controller, opened by its own driver: firmware, faults, battery. Nothing here moves the car."""

import asyncio
import math
from dataclasses import dataclass
from typing import Final

from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.drivers.api import Health, LinkState, MotorState
from wallride.drivers.pwm.driver import PwmMotor
from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.replies import Firmware
from wallride.runtime.control.battery import FULL_CELL_V, USB_ONLY_V, BatterySettings
from wallride.runtime.ending import end
from wallride.runtime.lidars import motor_for
from wallride.runtime.settings.devices import AnyMotorSettings

PATIENCE_S: Final = 7.0
OBSERVED_S: Final = 1.3
"""Time after the first report: the driver calls a voltage low after 1 s."""
HOT_C: Final = 75.0
SERVO_SINCE: Final = (5, 3)
TODAYS_LAYOUT_SINCE: Final = (3, 0)
MAX_CELLS: Final = 12
MAX_BAD_REPLIES: Final = 15
"""Of about 65; a busy computer misses some."""
_POLL_S: Final = 0.02

NO_TIMEOUT: Final = "stay within reach of its switch; of a Maestro set serial timeout and neutral: docs/devices.md"
CALIBRATE: Final = "put the car on the floor of a room: sudo systemctl stop wallride, sudo wallride calibrate"
PULSES: Final = ("neutral_us", "forward_us", "reverse_us", "throttle_us_per_mps", "steering_center_us")
REMEDIES: Final = (
    ("no such bus", "enable I2C (sudo raspi-config, or this computer's overlay), and see motor.bus"),
    ("no acknowledgement", "check the board's supply and wires; i2cdetect -y 1 shows its address for motor.chip"),
    ("group i2c", "sudo usermod -aG i2c USER, then log out and in again"),
    ("no answer of a Maestro", "name its command port in motor.address, and set it to USB Dual Port"),
    ("are wanted", "set this output to Servo without limits of speed and acceleration; see motor.throttle_channel"),
    ("no answer to FW_VERSION", "switch the VESC's battery on, check the port; switch it off and on"),
    ("not like a VESC", "name the VESC's own port in motor.address: another device has the same USB id"),
    ("no motor controller", "connect the VESC itself by USB, not another module"),
    ("another program", "end the program that holds the port (VESC Tool, ModemManager, a second wallride)"),
    ("permission", "sudo usermod -aG dialout USER, then log out and in again"),
    ("no such device", "plug it in; install the udev rules: sudo wallride service install"),
    ("no usable reply", "check the USB cable; switch the VESC off and on"),
)
_OTHERWISE: Final = "check the VESC's power and USB cable, and switch it off and on"


@dataclass(slots=True)
class MotorReport:
    """Answer of one look; state: the last report, None without one. bounds: what bounds the speed, in sentences."""

    health: Health
    state: MotorState | None = None
    firmware: Firmware | None = None
    bounds: tuple[str, ...] = ()


async def look_at_motor(settings: AnyMotorSettings, *, patience_s: float = PATIENCE_S) -> MotorReport:
    """Run the driver until it has reported for a while, or failed."""
    clock = asyncio.get_running_loop().time
    driver = motor_for(settings, clock=clock)
    running = asyncio.create_task(driver.run())
    report = MotorReport(driver.health)
    give_up_s = clock() + patience_s
    observed_until_s = math.inf
    try:
        while clock() < min(give_up_s, observed_until_s) and not running.done():
            if driver.state is not None:
                report.state = driver.state
                report.bounds = driver.words if isinstance(driver, PwmMotor) else ()
                observed_until_s = min(observed_until_s, clock() + OBSERVED_S)
            elif driver.health.link is LinkState.ABSENT and driver.health.message != Health().message:
                break
            await asyncio.sleep(_POLL_S)
    finally:
        report.health = Health(**{name: getattr(driver.health, name) for name in Health.__slots__})
        report.firmware = driver.firmware if isinstance(driver, Vesc) else None
        for error in await end(running):
            raise error
    return report


def judge_motor(report: MotorReport, battery: BatterySettings) -> list[Finding]:
    """Judge one look."""
    health, state = report.health, report.state
    if state is None:
        remedy = next((remedy for words, remedy in REMEDIES if words in health.message), _OTHERWISE)
        return [fail("motor", health.message, remedy)]
    found = [ok("motor", health.identity), _firmware(report.firmware), *_trouble(state)]
    if state.temperature_c > HOT_C:
        found.append(warn("motor heat", f"the VESC has {state.temperature_c:.0f} C", "let it cool, give it air"))
    if (bad := health.counts.get("checksum", 0) + health.counts.get("missed_reply", 0)) > MAX_BAD_REPLIES:
        found.append(
            warn("motor line", f"{bad} replies damaged or missing", "a short USB cable with a ferrite, off the motor's")
        )
    found += [warn("motor timeout", words, NO_TIMEOUT) for words in report.bounds if "timeout" in words]
    return [*found, *([] if math.isnan(state.voltage_v) else [judge_battery(state.voltage_v, battery)])]


def judge_pulses(settings: PwmSettings) -> Finding:
    """Say whether the pulses of this car were ever measured."""
    usual = type(settings)()
    if all(getattr(settings, name) == getattr(usual, name) for name in PULSES):
        return warn("pulses", "they are the defaults, of no car in particular", CALIBRATE)
    words = f"neutral {settings.neutral_us:g} us, forward from {settings.forward_us:g} us"
    return ok("pulses", f"{words}, {settings.throttle_us_per_mps:g} us for each m/s; wallride calibrate measures them")


def _firmware(firmware: Firmware | None) -> Finding:
    if firmware is None:
        return ok("motor firmware", "not reported")
    version = firmware.major, firmware.minor
    if version < TODAYS_LAYOUT_SINCE:
        return warn(
            "motor firmware", f"{firmware.version} is very old: it has no servo output without a special build",
            "update it with VESC Tool, then repeat the motor detection",
        )  # fmt: skip
    if version < SERVO_SINCE:
        return warn(
            "motor firmware", f"{firmware.version} has no setting for the servo output and no report of its timeout",
            "update it with VESC Tool to 5.03 or later, then repeat the motor detection",
        )  # fmt: skip
    return ok("motor firmware", firmware.version)


def _trouble(state: MotorState) -> list[Finding]:
    found = []
    if state.fault:
        words, _, remedy = state.fault.partition(": ")
        found.append(fail("motor fault", words, remedy or "switch the VESC off and on"))
    if state.killed:
        found.append(fail("kill switch", "it is on: the VESC releases the motor", "release the kill switch"))
    return found or [ok("motor fault", "none")]


def judge_battery(voltage_v: float, settings: BatterySettings) -> Finding:
    """Judge the pack's voltage at rest by its cells."""
    if voltage_v < USB_ONLY_V:
        return fail(
            "battery",
            f"{voltage_v:.1f} V: the VESC has only the USB cable's supply",
            "connect the battery, switch it on",
        )
    cells = math.ceil(voltage_v / FULL_CELL_V) if settings.cells == "auto" else int(settings.cells)
    cell_v = voltage_v / cells
    words = (
        f"{voltage_v:.1f} V, {cells} cells{'' if settings.cells != 'auto' else ' by its voltage'}, {cell_v:.2f} V each"
    )
    if cell_v > FULL_CELL_V or cells > MAX_CELLS:
        return fail(
            "battery", f"{words}: more than a full cell has", "set battery.cells to the pack's number in series"
        )
    if cell_v < settings.cutoff_v_per_cell:
        return fail("battery", f"{words}: empty", "charge or change it")
    if cell_v < settings.low_v_per_cell:
        return warn("battery", f"{words}: low, the car does not begin to drive", "charge or change it")
    return ok("battery", words)
