"""A driver over a pseudo-terminal, and waiting for what it does."""

import asyncio
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any
from unittest import mock

from tests import wire_time
from tests.waiting import until
from wallride.drivers import link
from wallride.drivers.api import Drive, LinkLost, LinkState, MotorState
from wallride.drivers.link import ByteLink
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.codec import Packet
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.devices.vesc import VescEmulator

PATIENCE_S = 10.0
BRAKE = codec.set_brake_current(VescSettings().brake_current_a)
CENTRE = codec.set_servo(0.5304)
GAIN = VescSettings().speed_to_erpm_gain
QUESTIONS = {Packet.FW_VERSION, Packet.GET_VALUES}


def controller(folder: Path, **settings: Any) -> VescEmulator:
    """Return an emulated controller by the clock of the loop."""
    return VescEmulator(folder / "vesc", clock=asyncio.get_running_loop().time, **settings)


def vesc_at(path: Path, **changes: float) -> Vesc:
    """A driver that is patient with a busy machine, unless told otherwise."""
    return Vesc(
        VescSettings.model_validate({"address": f"serial://{path}", "lost_after_s": 2.0, **changes}),
        clock=asyncio.get_running_loop().time,
    )


@asynccontextmanager
async def running(vesc: Vesc) -> AsyncIterator[asyncio.Task[None]]:
    task: asyncio.Task[None] = asyncio.ensure_future(vesc.run())
    try:
        yield task
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


@asynccontextmanager
async def ready(emulator: VescEmulator, **changes: float) -> AsyncIterator[Vesc]:
    vesc = vesc_at(emulator.link, **changes)
    async with running(vesc) as task:
        await until(lambda: vesc.health.link is LinkState.READY or task.done())
        yield vesc


def seen(vesc: Vesc) -> MotorState:
    assert vesc.state is not None
    return vesc.state


def commands(emulator: VescEmulator) -> list[bytes]:
    """Everything received but questions."""
    return [payload for _, payload in emulator.wire if payload[0] not in QUESTIONS]


async def sent(vesc: Vesc, emulator: VescEmulator, drive: Drive) -> list[bytes]:
    """Send one command and return what arrives of it."""
    count = len(commands(emulator))
    assert vesc.send(drive)
    await until(lambda: len(commands(emulator)) >= count + 2)
    return commands(emulator)[count:]


class TurningVesc(VescEmulator):
    """A controller whose wheels turn at `erpm`, whatever it is told."""

    erpm = round(GAIN)
    _steps = _stepped_s = 0.0

    def _on_payload(self, payload: bytes) -> None:
        now_s = self._clock()
        self._steps += (now_s - self._stepped_s) * self.erpm / 10
        self._stepped_s = now_s
        self.report(erpm=self.erpm, tachometer=round(self._steps))
        super()._on_payload(payload)


class Played:
    """A driver and its controller.

    writes: every piece that the driver wrote at once. broken: writing fails, as to a port that has gone.
    released: how often the driver has let the port go.
    """

    def __init__(self, folder: Path, **settings: Any) -> None:
        self.controller = TurningVesc(folder / "vesc", clock=asyncio.get_running_loop().time)
        self.vesc = vesc_at(self.controller.link, **{"lost_after_s": VescSettings().lost_after_s, **settings})
        self.writes: list[bytes] = []
        self.broken = False
        self.released = 0

    def sent(self, drive: Drive) -> bytes:
        """Send one command; return all that was written."""
        count = len(self.writes)
        assert self.vesc.send(drive)
        assert len(self.writes) == count + 1, "in one write"
        return self.writes[-1]

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        rig = self

        class Overheard(ByteLink):
            def write(self, data: bytes) -> None:
                if rig.broken:
                    raise LinkLost("gone")
                rig.writes.append(data)
                super().write(data)

            def close(self) -> None:
                rig.released += self._open
                super().close()

        self.controller.start()
        with mock.patch.object(link, "ByteLink", Overheard):
            async with running(self.vesc):
                yield
        self.controller.close()


def play(story: Callable[[Played], Awaitable[None]], **settings: Any) -> Played:
    """Let a driver run in virtual time while a story is told; it is cancelled at its end."""

    async def main() -> Played:
        with tempfile.TemporaryDirectory() as folder:
            rig = Played(Path(folder), **settings)
            async with rig.running():
                await story(rig)
            return rig

    played: Played = wire_time.run(main())
    return played
