"""PCA9685 registers. Pure. Source: NXP's data sheet, revision 4.

Each output has four registers: the count, of 4096 a period, at which it goes high, and that at which it goes low.
"""

from typing import Final

from wallride.drivers.pca9685.settings import Pca9685Settings

MODE1: Final = 0x00
PRESCALE: Final = 0xFE
FIRST_OUTPUT: Final = 0x06
OUTPUTS: Final = 16
SLEEP, AUTO_INCREMENT, RESTART = 0x10, 0x20, 0x80
OSCILLATOR_HZ: Final = 25e6
COUNTS: Final = 4096


def prescale(rate_hz: float) -> int:
    """Return the divisor for a rate."""
    return min(max(round(OSCILLATOR_HZ / (COUNTS * rate_hz)) - 1, 3), 255)


def rate_hz(divisor: int) -> float:
    """Return the rate of a divisor, which differs from the one asked for by 1 % or less."""
    return OSCILLATOR_HZ / (COUNTS * (divisor + 1))


def output(channel: int) -> int:
    """Return the first register of an output."""
    return FIRST_OUTPUT + 4 * channel


def counts(pulse_us: float, divisor: int) -> bytes:
    """Return the four registers of a pulse [us]: high at 0, low after it."""
    off = min(max(round(pulse_us * 1e-6 * rate_hz(divisor) * COUNTS), 0), COUNTS - 1)
    return bytes((0, 0, off & 0xFF, off >> 8))


def pulse_us(registers: bytes, divisor: int) -> float:
    """Return the pulse [us] of four registers."""
    return int.from_bytes(registers[2:4], "little") / COUNTS / rate_hz(divisor) * 1e6


def writes(settings: Pca9685Settings, divisor: int, steering_us: float, throttle_us: float) -> list[bytes]:
    """Return what is to be written for two pulses, the throttle first; one write where the outputs are neighbours."""
    pulses = {
        settings.throttle_channel: counts(throttle_us, divisor),
        settings.steering_channel: counts(steering_us, divisor),
    }
    first, second = sorted(pulses)
    if second == first + 1:
        return [bytes((output(first),)) + pulses[first] + pulses[second]]
    return [bytes((output(channel),)) + registers for channel, registers in pulses.items()]
