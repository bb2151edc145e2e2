"""An operator at a car: `wallride teleop` in a process of its own, over a radio link, on the bench of `bench`."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import chain
from pathlib import Path
from typing import Any

from tests.system.bench import Bench, bench
from tests.system.radio import Radio
from wallride.drivers.vesc.codec import Packet
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.live.runtime_process import WallrideProcess

CAR = "sim"
FOR_EVER_S = 600.0
HAND_MPS = 2.0


class Operated:
    """car: the bench. radio: what lies between it and its operators. status: what the car last said of itself.

    entrance: where operators connect.
    """

    def __init__(self, car: Bench, radio: Radio, folder: Path) -> None:
        self.car = car
        self.radio = radio
        self.entrance = radio.endpoint
        self.status: dict[str, Any] = {}
        self.operators: list[WallrideProcess] = []
        self._folder = folder

    async def operator(self, *steps: str, name: str = "ann", leaves: bool = False) -> WallrideProcess:
        """Start an operator who does this, lines of `time_s,buttons,speed,steering`, and then leaves or stays."""
        script = self._folder / f"script{len(self.operators)}.csv"
        script.write_text(
            "\n".join(["time_s,buttons,speed,steering", *steps, *([] if leaves else [f"{FOR_EVER_S},,0,0"])])
        )
        options = {"--script": str(script), "--connect": self.entrance, "--name": name, "--max-speed": "2"}
        process = WallrideProcess(["teleop", "--plain", *chain.from_iterable(options.items())])
        self.operators.append(process)
        await process.start()
        return process

    async def drive_by_hand(self, name: str = "ann") -> WallrideProcess:
        """Have an operator drive at full speed and keep holding everything.

        A computer that stands still for half a second meanwhile is a lost operator, rightly: then another one begins.
        """
        for last in (False, False, True):
            process = await self.operator("0,,0,0", "0.1,manual,0,0", "0.2,manual,1,0.1", name=name)
            try:
                await self.car.until(lambda: self.car.wheel_mps > 0.95 * HAND_MPS, "driving by hand", 10.0)
            except AssertionError:
                if last or not any(f"{name} was lost" in line for line in self.car.runtime.log):
                    raise
                process.kill()
                await process.wait()
            else:
                break
        return process

    async def brake_after(self, since_s: float, within_s: float = 2.0) -> float:
        """Return when the first brake since a moment was on the motor's wire."""
        await self.car.until(lambda: math.isfinite(self.car.first_brake_s(since_s)), "braking", within_s)
        return self.car.first_brake_s(since_s)

    def moves_after(self, since_s: float) -> list[float]:
        """Return when a speed was asked for since a moment."""
        commands = self.car.motor_commands(since_s)
        return [
            at_s for at_s, payload in commands
            if payload[0] == Packet.SET_RPM and any(payload[1:]) and at_s > since_s
        ]  # fmt: skip

    def standing(self) -> str:
        """Return what the car says of its operator."""
        return str((self.status.get("operator") or {}).get("standing"))


@asynccontextmanager
async def operated(tmp_path: Path, *assignments: str) -> AsyncIterator[Operated]:
    """Start car, radio and a listener; every process is ended on every way out."""
    endpoint = free_endpoint()
    settings = ["telemetry.enabled=true", f"telemetry.listen={endpoint}", "operator.slot_free_after_s=1"]
    async with bench(tmp_path, *settings, *assignments) as car:
        radio = Radio(int(endpoint.rpartition(":")[2]))
        await radio.start()
        scene = Operated(car, radio, tmp_path)
        listener = Bus(zenoh_config.client_config(endpoint, None))
        listener.subscribe(topics.key(CAR, topics.STATUS), lambda _, text, __: scene.status.update(topics.decode(text)))
        try:
            await _until_open(listener)
            yield scene
        finally:
            for process in scene.operators:
                process.kill()
            await asyncio.gather(*(process.wait() for process in scene.operators))
            await listener.close()
            await radio.close()


async def _until_open(bus: Bus) -> None:
    async with asyncio.timeout(15):
        while not bus.is_open:
            try:
                await bus.open()
            except OSError:
                await asyncio.sleep(0.1)
