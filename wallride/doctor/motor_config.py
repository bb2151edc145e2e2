"""What protects the car inside the VESC: command timeout, its brake current, servo output. Read, never written."""

from typing import Final

from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.drivers.address import parse_address
from wallride.drivers.vesc import settings_link
from wallride.drivers.vesc.app_config import APPS, PPM_APPS, AppConfig, decode_app_config
from wallride.drivers.vesc.settings import VescSettings

MAX_TIMEOUT_S: Final = 0.2
MIN_BRAKE_A: Final = 5.0
BY_TOOL_TIMEOUT: Final = (
    "VESC Tool: App Settings, General: Timeout 150 ms, Timeout Brake Current 10 A; then Write App Configuration"
)
BY_TOOL_SERVO: Final = "VESC Tool: App Settings, General: Enable Servo Output on; then Write App Configuration"
SET_TIMEOUT: Final = f"wallride vesc set; or {BY_TOOL_TIMEOUT}"
SET_SERVO: Final = f"wallride vesc set; or {BY_TOOL_SERVO}"
SET_APP: Final = "VESC Tool: App Settings, General: APP to use: No App or UART; then Write App Configuration"
MEASURE: Final = "measure it, wheels up: wallride doctor --wheels-up"


async def read_app_config(settings: VescSettings) -> AppConfig | None:
    """Ask the VESC for its application configuration; None where it does not answer, or its layout is not known."""
    configuration = await settings_link.read_app_config(parse_address(settings.address))
    return None if configuration is None else decode_app_config(configuration)


def judge_app_config(config: AppConfig | None) -> list[Finding]:
    """Judge the configuration; an unread one keeps its warning, because nothing else protects a car that hangs."""
    if config is None:
        words = "cannot be read from this firmware"
        return [
            warn("motor timeout", words, f"set it; {BY_TOOL_TIMEOUT}; then {MEASURE}"),
            warn("servo output", words, f"{BY_TOOL_SERVO}; then see the wheels steer in `wallride teleop`"),
        ]
    return [judge_timeout(config.timeout_s), judge_brake(config.timeout_brake_a), _servo(config), _app(config)]


def judge_timeout(timeout_s: float) -> Finding:
    """Judge the time after which the VESC stops obeying the last command; 0: never."""
    words = f"{timeout_s * 1000:.0f} ms"
    if timeout_s == 0:
        return fail("motor timeout", "none: the car keeps its speed when this computer hangs", SET_TIMEOUT)
    if timeout_s > MAX_TIMEOUT_S:
        return fail(
            "motor timeout",
            f"{words}: {timeout_s * 5:.1f} m under power at 5 m/s when this computer hangs",
            SET_TIMEOUT,
        )
    return ok("motor timeout", words)


def judge_brake(brake_a: float) -> Finding:
    """Judge the brake current after the timeout."""
    if brake_a < MIN_BRAKE_A:
        return fail("timeout brake", f"{brake_a:.1f} A: the car rolls on after the timeout", SET_TIMEOUT)
    return ok("timeout brake", f"{brake_a:.1f} A")


def _servo(config: AppConfig) -> Finding:
    if config.servo_output is None:
        return warn(
            "servo output", "this firmware has no setting for it: it needs a build with servo output",
            "update the firmware with VESC Tool to 5.03 or later, or see the wheels steer in `wallride teleop`",
        )  # fmt: skip
    if not config.servo_output:
        return fail("servo output", "disabled: the wheels do not steer", SET_SERVO)
    return ok("servo output", "enabled")


def _app(config: AppConfig) -> Finding:
    name = APPS.get(config.application, f"number {config.application}")
    if config.application in PPM_APPS:
        return fail("VESC app", f"{name} takes the servo's pin, and drives the motor too", SET_APP)
    return ok("VESC app", name)
