"""The emulated board that a car by servo pulses has in place of a VESC, as its settings name it."""

from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.sim.devices.esc import EmulatedEsc, esc_of
from wallride.sim.devices.maestro import MaestroEmulator
from wallride.sim.devices.pca9685 import Pca9685Chip, Pca9685Socket
from wallride.sim.devices.vesc import MotorDemand

PulseBoard = MaestroEmulator | EmulatedEsc


def start_board(
    settings: MaestroSettings | Pca9685Settings, folder: Path, stack: AsyncExitStack,
    on_command: Callable[[float, MotorDemand], None] = lambda _s, _demand: None,
) -> tuple[PulseBoard, str, str]:  # fmt: skip
    """Start a board with ESC and servo, until the stack closes.

    Return what moves the car, and the name and value of the setting that says where the board is.
    """
    esc = EmulatedEsc(esc_of(settings), on_command)
    throttle, steering = settings.throttle_channel, settings.steering_channel
    if isinstance(settings, Pca9685Settings):
        place, chip = folder / "i2c", Pca9685Chip(esc, throttle=throttle, steering=steering, chip=settings.chip)
        stack.callback(Pca9685Socket(chip, place).close)
        return esc, "socket", str(place)
    board = MaestroEmulator(esc, throttle=throttle, steering=steering)
    board.start_serial(folder / "maestro")
    stack.callback(board.close)
    return board, "address", f"serial://{folder / 'maestro'}"
