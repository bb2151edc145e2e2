"""A car whose servo and ESC are driven by a Pololu Maestro.

Its serial timeout stops the car where nothing commands it any more, and every valid command feeds it: so questions ride
with commands, and are asked alone only after a silence in which the timeout has passed.
"""

import asyncio
import math
import time
from typing import Final

from wallride.drivers.address import parse_address
from wallride.drivers.api import Clock, DriverError, LinkLost, ProtocolError
from wallride.drivers.link import ByteLink, open_link
from wallride.drivers.maestro import codec
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pwm.driver import NO_TIMEOUT, PwmMotor

CHECK_S: Final = 0.05
SILENT_S: Final = 0.5
"""Time without a command after which it is asked; a serial timeout must be shorter to count as one."""
ANSWER_S: Final = 0.1
LOST_S: Final = 0.3
"""Time of unanswered questions after which the link is lost."""
MAX_WRONG_ANSWERS: Final = 5
"""Maximum number of answers in a row with another position than the one asked for: fewer are noise."""
ANY_TARGET: Final = -1
OPEN_S: Final = 0.05


class Maestro(PwmMotor):
    """A `Motor` (see wallride.drivers.api)."""

    def __init__(self, settings: MaestroSettings, *, clock: Clock = time.monotonic) -> None:
        super().__init__(settings, clock=clock)
        self._serial = settings

    async def open_port(self) -> "MaestroPort":
        """Open the port, and see whether its timeout guards it."""
        link = await open_link(parse_address(self._serial.address), self._clock)
        link.tap = self.tap
        port = MaestroPort(link, self._serial, self._clock)
        try:
            await port.set_up()
        except BaseException:
            link.close()
            raise
        return port


class MaestroPort:
    """The open board. unguarded: "" where its serial timeout was seen to pass, and to end in neutral."""

    def __init__(self, link: ByteLink, settings: MaestroSettings, clock: Clock) -> None:
        self._link, self._settings, self._clock = link, settings, clock
        self.identity = "Pololu Maestro"
        self.unguarded, self.timed_out = NO_TIMEOUT, False
        self._lost = asyncio.ensure_future(link.lost())
        self._buffer = b""
        self._target = self._asked_target = 0
        self._written_s = self._asked_s = clock()
        self._unanswered_s = math.inf  # since when
        self._wrong_answers = 0
        self._awaiting = False
        self._answer: tuple[int, int] | None = None

    async def set_up(self) -> None:
        """Meet it in neutral, and keep silent until a serial timeout must have passed."""
        self._link.listen(lambda _chunk, _read_at_s: None)
        self._link.write(codec.ERRORS_OF_ANY_MODE + bytes((codec.GET_ERRORS,)))
        await self._pause(OPEN_S)
        self._link.listen(self._on_bytes)
        for _ in range(2):  # neutral, so that the silence changes nothing; the first answer clears old errors
            self._write_neutral()
            self._ask()
            await self._pause(ANSWER_S)
        self._recognise()
        await self._pause(SILENT_S)
        self._ask()
        await self._pause(ANSWER_S)
        self.unguarded = self._why_unguarded()
        self.timed_out = False

    def _recognise(self) -> None:
        """Refuse what answers nothing, or not as a Maestro does."""
        where, channel = self._link.address, self._settings.throttle_channel
        if self._answer is None:
            raise LinkLost(f"{where}: no answer of a Maestro (its command port? power? mode USB Dual Port?)")
        if (position := self._answer[0]) != self._target:
            raise ProtocolError(
                f"{where}: output {channel} is at {position / 4:.0f} us where {self._target / 4:.0f} us are wanted"
                " (a Maestro? is that output a servo's, without a speed limit?)"
            )

    def _why_unguarded(self) -> str:
        """Return what is wrong with the timeout that was waited for, by where it has left the throttle."""
        settings = self._settings
        if not self.timed_out or self._answer is None:
            return NO_TIMEOUT
        went_us = self._answer[0] / codec.PER_US
        low_us, high_us = sorted((settings.reverse_us, settings.forward_us))
        if low_us <= went_us <= high_us:
            return ""
        return f"its board's timeout goes to {went_us:.0f} us, which drives (neutral is {settings.neutral_us:.0f} us)"

    def write(self, steering_pulse_us: float, throttle_pulse_us: float) -> None:
        """Write both pulses, and a question unless one waits for its answer."""
        settings, now_s = self._settings, self._clock()
        data = codec.set_target(settings.throttle_channel, throttle_pulse_us)
        data += codec.set_target(settings.steering_channel, steering_pulse_us)
        self._target = codec.quarters(throttle_pulse_us)
        self._written_s = now_s
        self._link.write(data)
        self._give_up(now_s)
        if not self._awaiting:
            self._ask()

    async def check(self) -> None:
        """Look whether it answers and holds its throttle."""
        await self._pause(CHECK_S)
        now_s = self._clock()
        self._give_up(now_s)
        if not self._awaiting and now_s - max(self._written_s, self._asked_s) > SILENT_S:
            self._ask()
        if now_s - self._unanswered_s > LOST_S:
            raise LinkLost(f"{self._link.address}: no answer for {now_s - self._unanswered_s:.1f} s (power? cable?)")
        if self._wrong_answers > MAX_WRONG_ANSWERS:
            raise DriverError(f"{self._link.address}: it does not hold its throttle (brown-out? another program?)")

    def close(self) -> None:
        """Close the port."""
        self._lost.cancel()
        self._link.close()

    async def _pause(self, pause_s: float) -> None:
        await asyncio.wait({self._lost}, timeout=pause_s)
        if self._lost.done():
            self._lost.result()

    def _write_neutral(self) -> None:
        self._target = codec.quarters(self._settings.neutral_us)
        self._link.write(codec.set_target(self._settings.throttle_channel, self._settings.neutral_us))

    def _ask(self) -> None:
        now_s = self._clock()
        alone = now_s - self._written_s > SILENT_S  # then its timeout may have moved the output
        self._awaiting, self._buffer, self._asked_s = True, b"", now_s
        self._asked_target = ANY_TARGET if alone else self._target
        self._unanswered_s = min(self._unanswered_s, now_s)
        self._link.write(codec.question(self._settings.throttle_channel))

    def _give_up(self, now_s: float) -> None:
        """Drop a question without an answer, so that the next one may be asked."""
        if self._awaiting and now_s - self._asked_s > ANSWER_S:
            self._awaiting, self._buffer = False, b""

    def _on_bytes(self, chunk: bytes, _read_at_s: float) -> None:
        if not self._awaiting:
            return  # nothing was asked: noise
        self._buffer += chunk
        if len(self._buffer) < codec.ANSWER_BYTES:
            return
        answer, self._awaiting = codec.decode_answer(self._buffer), False
        if answer is None:
            return
        self._answer, self._unanswered_s = answer, math.inf
        self.timed_out = bool(answer[1] & codec.SERIAL_TIMEOUT)
        right = self._asked_target in {ANY_TARGET, answer[0]}
        self._wrong_answers = 0 if right else self._wrong_answers + 1
