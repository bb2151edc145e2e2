"""A YDLIDAR: how it is found, started and stopped. The connection itself is in `drivers/turning`."""

import asyncio
import time
from typing import Final

from wallride.drivers.api import Clock, LinkLost, ProtocolError, Reschedule, as_wanted
from wallride.drivers.turning.conversation import LidarTalk
from wallride.drivers.turning.driver import FAULT_STAYS, TurningLidar
from wallride.drivers.turning.grid import AskMotion, standing
from wallride.drivers.turning.replies import SensorInfo, decode_info
from wallride.drivers.turning.stream import StreamFacts
from wallride.drivers.ydlidar import codec
from wallride.drivers.ydlidar.models import CODES, MODELS, Model
from wallride.drivers.ydlidar.settings import YdlidarSettings

STOP_S: Final = 0.1
MOTOR_S: Final = 0.5
"""Time that the motor takes to follow its line."""
RESET_S: Final = 3.0
INFO_TIMEOUT_S: Final = 0.6
LISTEN_S: Final = 2.0
"""Time in which a sensor that never answers has to be heard: its motor starts meanwhile."""
ENOUGH_PACKETS: Final = 3


class Ydlidar(TurningLidar):
    """A `Lidar` (see wallride.drivers.api): a YDLIDAR at a serial port, or at a bridge to one."""

    word = "YDLIDAR"

    def __init__(
        self,
        settings: YdlidarSettings,
        *,
        clock: Clock = time.monotonic,
        clear_s: Reschedule = as_wanted,
        motion: AskMotion = standing,
    ) -> None:
        named = MODELS.get(settings.model)
        usual = {model.baud for model in MODELS.values() if not model.one_way}
        bauds = (named.baud,) if named is not None else tuple(sorted(usual))
        super().__init__(settings, bauds, clock=clock, clear_s=clear_s, motion=motion)
        self._named = named
        self._model = named or MODELS["x4"]

    async def _greet(self, talk: LidarTalk) -> str:
        """Stop what it does, and ask who it is and how it is; one that never answers is listened to."""
        talk.link.set_data_terminal_ready(False)
        talk.link.write(codec.command(codec.STOP))
        await asyncio.sleep(STOP_S)
        if self._model.one_way:
            return await self._overhear(talk)
        await talk.become_quiet()
        reply = await talk.ask_patiently(codec.command(codec.GET_INFO), codec.INFO, tries=2, timeout_s=INFO_TIMEOUT_S)
        info = decode_info(reply.payload)
        if info is None:
            raise ProtocolError(
                f"{talk.link.address}: its identity has {len(reply.payload)} bytes, not 20 (a YDLIDAR?)"
            )
        self._model = self._named_model(talk, info)
        if await self._is_broken(talk):
            await self._reset(talk)
        major, minor = info.firmware
        return f"YDLIDAR {self._model.name}, firmware {major}.{minor}, serial {_digits(info.serial)}"

    async def _start(self, talk: LidarTalk) -> StreamFacts:
        """Start motor and stream."""
        talk.link.set_data_terminal_ready(True)
        decoder = codec.PacketDecoder(self._model, self.health.count)
        model = self._model
        if not model.one_way:
            await asyncio.sleep(MOTOR_S)
            await self._ask_stream(talk, codec.command(codec.SCAN), codec.STREAM)
        return StreamFacts(decoder, model.sample_s, *model.range_m, f"YDLIDAR {model.name}", talk.take_rest())

    async def _leave(self, talk: LidarTalk) -> None:
        """Stop measuring and the motor."""
        talk.link.write(codec.command(codec.STOP))
        talk.link.set_data_terminal_ready(False)
        await asyncio.sleep(STOP_S)

    def _named_model(self, talk: LidarTalk, info: SensorInfo) -> Model:
        """Return the model that the settings name, of which the sensor must not deny to be, else the one it says."""
        told = CODES.get(info.model)
        if self._named is not None:
            if told is not None and MODELS[told] != self._named:
                raise ProtocolError(
                    f"{talk.link.address}: a YDLIDAR {MODELS[told].name}, and lidar.model names a {self._named.name},"
                    " whose distances count otherwise"
                )
            return self._named
        if told is None:
            raise ProtocolError(
                f"{talk.link.address}: a YDLIDAR of the unknown model {info.model} (name one like it in lidar.model)"
            )
        return MODELS[told]

    async def _overhear(self, talk: LidarTalk) -> str:
        """Return the identity of a sensor that never answers, once its packets come."""
        decoder = codec.PacketDecoder(self._model, lambda _what: None)
        talk.link.set_data_terminal_ready(True)
        talk.link.listen(lambda chunk, _read_at_s: (decoder.packets_in(chunk), None)[1])
        for _ in range(round(LISTEN_S / STOP_S)):
            await asyncio.sleep(STOP_S)
            if decoder.packets >= ENOUGH_PACKETS:
                talk.listen()
                return f"YDLIDAR {self._model.name}, which does not tell its serial number"
        self.health.count("not heard")
        raise LinkLost(
            f"{talk.link.address}: no scan packet of a {self._model.name} at {self._model.baud} baud"
            " (power? cable? another lidar.model?)"
        )

    async def _is_broken(self, talk: LidarTalk) -> bool:
        """Ask for its condition, in both ways that the manuals name; no answer is none."""
        for code in (codec.GET_HEALTH, codec.GET_HEALTH_OLD):
            try:
                reply = await talk.ask(codec.command(code), codec.HEALTH)
            except LinkLost:
                continue
            return self._tells_fault(reply)
        self.health.count("no condition told")
        return False

    async def _reset(self, talk: LidarTalk) -> None:
        self.health.count("reset")
        for code in (codec.RESET, codec.RESET_OLD):
            talk.link.write(codec.command(code))
            await asyncio.sleep(STOP_S)
        await asyncio.sleep(RESET_S)
        await talk.become_quiet()
        if await self._is_broken(talk):
            raise ProtocolError(f"{talk.link.address}: {FAULT_STAYS}")


def _digits(serial: bytes) -> str:
    """Return a serial number that is sent as one decimal digit a byte."""
    return "".join(str(digit) if digit < 10 else "?" for digit in serial)
