"""An RPLIDAR: how it is found, started and stopped. The connection itself is in `drivers/turning`."""

import asyncio
import time
from typing import Final

from wallride.drivers.api import Clock, LinkLost, ProtocolError, Reschedule, as_wanted, printable
from wallride.drivers.rplidar import capsules, codec, models
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.turning.conversation import LidarTalk
from wallride.drivers.turning.driver import FAULT_STAYS, TurningLidar
from wallride.drivers.turning.grid import AskMotion, standing
from wallride.drivers.turning.replies import SensorInfo, decode_info
from wallride.drivers.turning.samples import SampleDecoder
from wallride.drivers.turning.stream import StreamFacts
from wallride.drivers.value import value

BAUDS: Final = (115200, 256000, 460800, 1_000_000)
STOP_S: Final = 0.1
"""Time after STOP in which the sensor takes no command."""
RESET_S: Final = 2.0
USUAL_DUTY: Final = 660
USUAL_RPM: Final = 600
_PLAIN_S, _EXPRESS_S = 1 / 2000, 1 / 4000
"""Time of a sample where the sensor does not tell it."""
MIN_SAMPLE_S, MAX_SAMPLE_S, MAX_RANGE_M, MAX_MODE = 1e-6, 1e-2, 100.0, 255
"""Bounds of what a sensor tells of its mode: replies have no checksum."""
MAX_NAME_B: Final = 40


@value()
class Mode:
    """A stream: its number (None: plain samples), type, time of a sample, and the farthest distance in it."""

    number: int | None
    kind: int
    sample_s: float
    range_max_m: float
    name: str


class Rplidar(TurningLidar):
    """A `Lidar` (see wallride.drivers.api): any RPLIDAR at a serial port, or at a bridge to one."""

    word = "RPLIDAR"

    def __init__(
        self,
        settings: RplidarSettings,
        *,
        clock: Clock = time.monotonic,
        clear_s: Reschedule = as_wanted,
        motion: AskMotion = standing,
    ) -> None:
        super().__init__(settings, BAUDS, clock=clock, clear_s=clear_s, motion=motion)
        self._plain_only, self._speed_rpm = settings.mode == "standard", settings.speed_rpm or USUAL_RPM
        self._info = SensorInfo(0, (0, 0), 0, b"")

    async def _greet(self, talk: LidarTalk) -> str:
        """Stop what it does, and ask who it is and how it is; a sensor in protection stop is reset once."""
        await self._stop(talk)
        reply = await talk.ask_patiently(codec.command(codec.GET_INFO), codec.INFO, tries=3)
        info = decode_info(reply.payload)
        if info is None:
            raise ProtocolError(
                f"{talk.link.address}: its identity has {len(reply.payload)} bytes, not 20 (an RPLIDAR?)"
            )
        self._info = info
        if await self._is_protected(talk):
            self.health.count("reset")
            talk.link.write(codec.command(codec.RESET))
            await asyncio.sleep(RESET_S)
            await self._stop(talk)
            if await self._is_protected(talk):
                raise ProtocolError(f"{talk.link.address}: {FAULT_STAYS}")
        major, minor = info.firmware
        return f"{models.name_of(info)}, firmware {major}.{minor:02d}, serial {info.serial.hex().upper()}"

    async def _start(self, talk: LidarTalk) -> StreamFacts:
        """Start motor and stream."""
        mode = await self._mode(talk)
        await self._turn(talk, on=True)
        command = codec.command(codec.SCAN) if mode.number is None else codec.express_scan(mode.number)
        reply = await self._ask_stream(talk, command, mode.kind)
        if not reply.streams:
            raise ProtocolError(f"{talk.link.address}: it announces no stream in mode {mode.name} (power-cycle it)")
        decoder = self._decoder(mode)
        summary = f"{models.name_of(self._info)}, {mode.name}"
        return StreamFacts(decoder, mode.sample_s, models.RANGE_MIN_M, mode.range_max_m, summary, talk.take_rest())

    async def _leave(self, talk: LidarTalk) -> None:
        """Stop measuring, then the motor: it keeps turning with neither."""
        talk.link.write(codec.command(codec.STOP))
        await asyncio.sleep(STOP_S)
        await self._turn(talk, on=False)
        await asyncio.sleep(STOP_S / 2)

    async def _stop(self, talk: LidarTalk) -> None:
        talk.link.set_data_terminal_ready(False)
        talk.link.write(codec.command(codec.STOP))
        await asyncio.sleep(STOP_S)
        await talk.become_quiet()

    async def _is_protected(self, talk: LidarTalk) -> bool:
        return self._tells_fault(await talk.ask_patiently(codec.command(codec.GET_HEALTH), codec.HEALTH, tries=2))

    def _decoder(self, mode: Mode) -> SampleDecoder:
        decoder = capsules.decoder_for(mode.kind, self.health.count)
        return codec.PlainDecoder(self.health.count) if decoder is None else decoder

    async def _mode(self, talk: LidarTalk) -> Mode:
        """Return the stream to use, as far as the sensor tells its configuration."""
        plain_s, express_s = await self._sample_times(talk)
        plain = Mode(None, codec.PLAIN, plain_s, models.RANGE_MAX_M, "plain")
        if self._plain_only:
            return plain
        if not models.tells_configuration(self._info):
            express = Mode(0, capsules.EXPRESS, express_s, models.RANGE_MAX_M, "express")
            return express if models.has_express(self._info) else plain
        number = _number(await self._told(talk, codec.TYPICAL_MODE))
        if number > MAX_MODE:
            raise ProtocolError(f"{talk.link.address}: its mode {number} makes no sense (power-cycle it)")
        kind = (await self._told(talk, codec.ANSWER, number))[0]
        sample_s = _number(await self._told(talk, codec.US_PER_SAMPLE, number)) / 256 * 1e-6
        range_max_m = _number(await self._told(talk, codec.MAX_DISTANCE, number)) / 256
        if kind != codec.PLAIN and capsules.decoder_for(kind, lambda _what: None) is None:
            raise ProtocolError(
                f'{talk.link.address}: its stream of type {kind:#04x} is unknown (lidar.mode = "standard" avoids it)'
            )
        if not (MIN_SAMPLE_S < sample_s < MAX_SAMPLE_S and models.RANGE_MIN_M < range_max_m <= MAX_RANGE_M):
            raise ProtocolError(f"{talk.link.address}: its mode {number} makes no sense (power-cycle it)")
        name = printable((await self._told(talk, codec.MODE_NAME, number)).split(b"\0")[0][:MAX_NAME_B])
        return Mode(
            None if kind == codec.PLAIN else number, kind, sample_s, range_max_m, name.strip() or f"mode {number}"
        )

    async def _sample_times(self, talk: LidarTalk) -> tuple[float, float]:
        if not models.has_express(self._info) and not models.tells_configuration(self._info):
            return _PLAIN_S, _EXPRESS_S
        try:
            reply = await talk.ask(codec.command(codec.GET_SAMPLE_TIME), codec.SAMPLE_TIME)
        except LinkLost:
            return _PLAIN_S, _EXPRESS_S
        plain_us, express_us = codec.decode_sample_times_us(reply.payload) or (0, 0)
        return plain_us * 1e-6 or _PLAIN_S, express_us * 1e-6 or _EXPRESS_S

    async def _told(self, talk: LidarTalk, key: int, mode: int | None = None) -> bytes:
        reply = await talk.ask_patiently(codec.ask_configuration(key, mode), codec.CONFIGURATION, tries=2)
        told = codec.decode_configuration(reply.payload, key)
        if told is None:
            raise ProtocolError(f"{talk.link.address}: it answers another question than {key:#04x} (power-cycle it)")
        return told

    async def _turn(self, talk: LidarTalk, *, on: bool) -> None:
        """Start or stop the motor, the way of the model."""
        motor = models.motor_of(self._info)
        talk.link.set_data_terminal_ready(not on)
        if motor is models.HeadDrive.BOARD:
            talk.link.write(codec.set_pwm(USUAL_DUTY if on else 0))
        elif motor is models.HeadDrive.SPEED:
            talk.link.write(codec.set_speed(self._speed_rpm if on else 0))
        await asyncio.sleep(0.02)


def _number(told: bytes) -> int:
    """Return a number of the configuration, of 4 bytes at most."""
    return int.from_bytes(told[:4], "little")
