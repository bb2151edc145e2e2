"""A driver over a pseudo-terminal, and waiting for what it does."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from wallride.drivers.api import Drive, LinkState, MotorState
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.codec import Packet
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.devices.vesc import VescEmulator

PATIENCE_S = 10.0
BRAKE = codec.set_brake_current(VescSettings().brake_current_a)
CENTRE = codec.set_servo(0.5304)


def controller(folder: Path, **settings: Any) -> VescEmulator:
    """Return an emulated controller by the clock of the loop."""
    return VescEmulator(folder / "vesc", clock=asyncio.get_running_loop().time, **settings)


async def until(met: Callable[[], object]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not met():
            await asyncio.sleep(0.001)


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
    return [payload for _, payload in emulator.wire if payload[0] not in {Packet.FW_VERSION, Packet.GET_VALUES}]


async def sent(vesc: Vesc, emulator: VescEmulator, drive: Drive) -> list[bytes]:
    """Send one command and return what arrives of it."""
    count = len(commands(emulator))
    assert vesc.send(drive)
    await until(lambda: len(commands(emulator)) >= count + 2)
    return commands(emulator)[count:]
