"""`wallride calibrate` of a car by servo pulses: opens its lidar and board itself, in the place of its process.

Each step has a pair of devices, in an event loop of its own. Whatever ends a step, the car is stopped and the last
pulse is neutral: an error, Ctrl-C, a lost lidar, a terminal that goes away.
"""

import argparse
import signal
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any, Final

from wallride.clients.calibration import DELAY, STEPS
from wallride.clients.calibration.command import begin, check_yes, drive_steps, finish
from wallride.clients.calibration.current_values import PULSE_NAMES, check_writable
from wallride.clients.calibration.link import HeldDeadman
from wallride.clients.calibration.pulse_steps import NO_DELAY, pulse_steps
from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.loop_thread import LoopThread
from wallride.doctor.computer import Computer, this_computer
from wallride.doctor.examine import ACTIVE
from wallride.doctor.ports import running_car
from wallride.drivers.api import Scan
from wallride.drivers.pwm.settings import PwmSettings
from wallride.pulses.devices import PulseDevices
from wallride.pulses.link import PulseLink
from wallride.runtime.host.terminal_text import say
from wallride.runtime.parameters.catalogue import values
from wallride.runtime.parameters.file import StoreError
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings

ENDING: Final = (signal.SIGTERM, signal.SIGHUP)


class PulseBench:
    """Implements OpenBench with the devices of these settings."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._thread: LoopThread | None = None
        self._devices: PulseDevices | None = None
        self._handlers: dict[signal.Signals, Any] = {}

    def open(self, steering_us: float, neutral_us: float) -> None:
        """Open board and lidar, in neutral; CalibrationError with the remedy."""
        self._handlers = {number: signal.signal(number, _leave) for number in ENDING}
        self._thread = LoopThread()

        async def open_devices() -> None:
            self._devices = PulseDevices(self._settings, steering_us, neutral_us)
            await self._devices.open()

        self._thread.call(open_devices())

    def write(self, steering_us: float, throttle_us: float, neutral_us: float) -> tuple[float, float]:
        """Write pulses [us]; return those that the board makes of them."""
        thread, devices = self._opened()
        return thread.call(devices.order(steering_us, throttle_us, neutral_us))

    def next_scan(self) -> Scan:
        """Return the newest scan; CalibrationError where none comes, or the board is lost."""
        thread, devices = self._opened()
        return thread.call(devices.next_scan())

    def close(self, stop_us: float, neutral_us: float) -> None:
        """Stop, then neutral; close both."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        try:
            if self._devices is not None:
                thread.call(self._devices.close(stop_us, neutral_us))
        finally:
            thread.close()
            for number, handler in self._handlers.items():
                signal.signal(number, handler)

    def _opened(self) -> tuple[LoopThread, PulseDevices]:
        if self._thread is None or self._devices is None:
            raise CalibrationError("lidar and board are not open")
        return self._thread, self._devices


def _leave(number: int, _frame: FrameType | None) -> None:
    """End as Ctrl-C does: a terminal that went away ends the process, and a board may go on with its last pulse."""
    raise SystemExit(128 + number)


def pulsed_settings(path: Path) -> Settings | None:
    """Return the settings of a car by servo pulses; None for another car, and for a file that cannot be read."""
    try:
        settings = load_settings(path)
    except SettingsError:
        return None  # the car's own way to refuse it follows
    return settings if isinstance(settings.motor, PwmSettings) else None


def run(options: argparse.Namespace, settings: Settings) -> int:
    """Calibrate; ConnectionProblemError for what the user can correct."""
    try:
        return _calibrate(options, settings)
    except (StoreError, SettingsError, CalibrationError) as error:
        raise ConnectionProblemError(str(error)) from None


def _calibrate(options: argparse.Namespace, settings: Settings) -> int:
    path: Path = options.config
    wanted = frozenset(options.steps or STEPS)
    check_writable(path)
    say(f"settings of {path}")
    check_yes(given=options.yes, simulated=settings.recording.simulated)
    refuse_running_car(this_computer(), settings)
    if DELAY in wanted:
        say(NO_DELAY)
    bench, now = PulseBench(settings), values_of(settings)
    so_far, measured = begin(now, options.wheelbase)

    def open_link(deadman: HeldDeadman) -> PulseLink:
        return PulseLink(bench, deadman, settings, so_far.now)

    measured += drive_steps(open_link, pulse_steps(wanted), so_far, always=options.yes)
    return finish(path, wanted, now, so_far, measured, yes=options.yes)


def values_of(settings: Settings) -> Mapping[str, float]:
    """Return the values in effect that a calibration uses or measures."""
    known = values(settings)
    return {name: float(str(known[name])) for name in PULSE_NAMES}


def refuse_running_car(computer: Computer, settings: Settings) -> None:
    """CalibrationError where the car's own process has the devices."""
    if computer.path(ACTIVE).is_symlink():
        raise CalibrationError(
            "the car's service runs and has lidar and board: sudo systemctl stop wallride, then calibrate again"
        )
    if (pid := running_car(computer, settings)) is not None:
        raise CalibrationError(
            f"the car runs and has lidar and board (wallride run, process {pid}): end it with Ctrl-C, then calibrate"
            " again"
        )
