"""An emulated Pololu Maestro: bytes over a pseudo-terminal or TCP, an ESC and a servo at its outputs."""

import time
from typing import ClassVar, Final

from wallride.drivers.api import Clock
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.sensor_port import SensorPort
from wallride.sim.devices.vesc import MotorDemand

_TIMEOUT, _PROTOCOL = 0x20, 0x10
_LENGTHS: Final = {0x84: 4, 0x90: 2, 0xA1: 1, 0xAA: 3, 0xA2: 1}
DEVICE: Final = 12


class MaestroEmulator(SensorPort):
    """The board. timeout_s: its serial timeout, 0: none; then the throttle goes to home_us.

    Faults beside those of `SensorPort`: `brown_out`, held_us (an output that does not follow). counts: also "command",
    the throttle's.
    """

    held_frames: ClassVar = 400
    garbage_bytes: ClassVar = 8

    def __init__(
        self, esc: EmulatedEsc, *, throttle: int = 0, steering: int = 1, timeout_s: float = 0.2,
        clock: Clock = time.monotonic,
    ) -> None:  # fmt: skip
        super().__init__(clock, seed=1)
        self.esc = esc
        self.timeout_s, self.home_us = timeout_s, esc.model.neutral_us
        self.held_us: float | None = None
        self._throttle, self._steering = throttle, steering
        self._targets = {throttle: 0, steering: 0}
        self._line = b""
        self._errors = 0
        self._fed_s = clock()

    def brown_out(self) -> None:
        """Lose the supply for a moment; the computer's adapter stays."""
        self._targets = dict.fromkeys(self._targets, 0)
        self._line, self._errors = b"", 0
        self.esc.power_cycle()

    @property
    def imu(self) -> tuple[float, ...]:
        """It has no inertial sensor."""
        return ()

    @imu.setter
    def imu(self, _measured: tuple[float, ...]) -> None:
        """Drop what the simulated car measures."""

    @property
    def servo(self) -> float:
        """Return the servo position that stands for the commanded angle."""
        return self.esc.servo

    def demand(self, now_s: float) -> MotorDemand:
        """Return the present demand on the motor."""
        self._look_at_timeout(now_s)
        return self.esc.demand(now_s)

    def report(self, erpm: float, tachometer: int) -> None:
        """Note the wheels' motion."""
        self.esc.report(erpm, tachometer)

    def _look_at_timeout(self, now_s: float) -> None:
        if self.timeout_s and now_s - self._fed_s > self.timeout_s and not self._errors & _TIMEOUT:
            self._errors |= _TIMEOUT
            self._targets[self._throttle] = round(self.home_us * 4)
            self._pulse(now_s)

    def _answers(self, chunk: bytes) -> list[bytes]:
        now_s, answers, moved = self._clock(), [], False
        self._line += chunk
        while self._line:
            length = _LENGTHS.get(self._line[0])
            if length is None:
                self._errors |= _PROTOCOL
                self._line = self._line[1:]
                continue
            if len(self._line) < length:
                break
            said, self._line = self._line[:length], self._line[length:]
            self._look_at_timeout(now_s)
            self._fed_s = now_s
            if said[0] == 0x84 and said[1] in self._targets:
                self._targets[said[1]] = said[2] | said[3] << 7
                moved = moved or said[1] == self._throttle
            answers += self._answer(said)
        if moved:
            self.counts["command"] += 1
            self._pulse(now_s)
        return answers

    def _answer(self, said: bytes) -> list[bytes]:
        if said[0] == 0x90:
            held = self.held_us if said[1] == self._throttle else None
            target = self._targets.get(said[1], 0) if held is None else round(held * 4)
            return [target.to_bytes(2, "little")]
        if said[0] == 0xA1 or (said[0] == 0xAA and said[1:] == bytes((DEVICE, 0x21))):
            errors, self._errors = self._errors, 0
            return [errors.to_bytes(2, "little")]
        return []

    def _pulse(self, now_s: float) -> None:
        if not self._targets[self._throttle]:
            self.esc.no_signal()
            return
        self.esc.pulse(self._targets[self._steering] / 4 or 1500.0, self._targets[self._throttle] / 4, now_s)
