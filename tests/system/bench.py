"""A car on a test bench: the unmodified runtime process between an emulated lidar and an emulated motor controller."""

import asyncio
import math
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import takewhile
from pathlib import Path

import numpy as np

from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.live.runtime_process import RuntimeProcess
from wallride.sim.recordings.recording import to_sensor_mm
from wallride.sim.virtual.devices import ranges_between_walls

ROOT = Path(__file__).resolve().parents[2]
CORRIDOR_MM = to_sensor_mm(ranges_between_walls(1.0, 1.0), 0.02, 30.0)
BLOCKED_MM = to_sensor_mm(ranges_between_walls(1.0, 1.0, ahead_m=0.8), 0.02, 30.0)
GAIN = 4614.0
STARTS_WITHIN_S = 50.0
"""Time for the process to start, too: on a full computer its imports alone take longer than all that is promised."""


class Bench:
    """scan_mm: what the lidar shows from now on; None is a lidar that turns without sending.

    last_good_scan_s: when the newest scan left the sensor. stamp_jump_ms: what the sensor's clock is off from now on.
    voltage_v: of the battery.
    """

    def __init__(self, scip: ScipEmulator, vesc: VescEmulator) -> None:
        self.scip = scip
        self.vesc = vesc
        self.runtime: RuntimeProcess
        self.lidar_port = 0
        self.scan_mm: np.ndarray | None = CORRIDOR_MM
        self.last_good_scan_s = 0.0
        self.stamp_jump_ms = 0
        self.voltage_v = 11.8
        self.wheel_mps = 0.0
        self._distance_m = 0.0

    async def turn(self) -> None:
        """Turn the lidar at 40 Hz and the wheels as they are asked."""
        loop = asyncio.get_running_loop()
        start_s = next_s = loop.time()
        while True:
            next_s += 0.025
            await asyncio.sleep(max(0.0, next_s - loop.time()))
            self._move_wheels(0.025)
            if self.scan_mm is not None:
                # No sensor repeats a scan bit for bit, not even an old one.
                flicker_mm = np.random.default_rng(self.scip.counts["published"]).integers(0, 5, self.scan_mm.size)
                sent_s = self.scip.publish(
                    self.scan_mm + flicker_mm, round((next_s - start_s) * 1000) + self.stamp_jump_ms
                )
                self.last_good_scan_s = sent_s or self.last_good_scan_s

    def _move_wheels(self, dt_s: float) -> None:
        demand = self.vesc.demand(time.monotonic())
        wanted_mps = demand.value / GAIN if demand.kind == "speed" else 0.0
        most_mps = {"speed": 5.4, "brake": 6.0 if demand.value > 1 else 0.0}.get(demand.kind, 0.2) * dt_s
        self.wheel_mps += max(-most_mps, min(most_mps, wanted_mps - self.wheel_mps))
        self._distance_m += self.wheel_mps * dt_s
        self.vesc.report(
            erpm=round(self.wheel_mps * GAIN), tachometer=round(self._distance_m * GAIN / 10), voltage_v=self.voltage_v
        )

    def motor_commands(self, since_s: float = 0.0) -> list[tuple[float, bytes]]:
        """Return (time, payload) of the motor commands on the wire."""
        # From the end: asked every few milliseconds, while a long test's wire has tens of thousands of entries.
        recent = takewhile(lambda entry: entry[0] >= since_s, reversed(self.vesc.wire))
        return [entry for entry in recent if entry[1][0] in MOTOR_PACKETS][::-1]

    def first_brake_s(self, since_s: float) -> float:
        """Return when the first brake after a moment arrived; infinity while there is none."""
        brakes = (at_s for at_s, payload in self.motor_commands(since_s) if payload[0] == Packet.SET_CURRENT_BRAKE)
        return next(brakes, math.inf)

    async def until(self, condition: Callable[[], bool], what: str, within_s: float = 10.0) -> None:
        """Wait for something that must happen."""
        try:
            async with asyncio.timeout(within_s):
                while not condition():
                    assert self.runtime.exit_code is None or "exit" in what, "\n".join(self.runtime.log)
                    await asyncio.sleep(0.005)
        except TimeoutError:
            raise AssertionError(
                f"{what} did not happen in {within_s} s; log:\n" + "\n".join(self.runtime.log)
            ) from None

    async def until_driving(self, speed_mps: float = 0.9) -> None:
        """Wait until the wheels turn at nearly the asked speed."""
        await self.until(lambda: self.wheel_mps >= speed_mps, f"driving at {speed_mps} m/s", STARTS_WITHIN_S)


@asynccontextmanager
async def bench(
    tmp_path: Path, *assignments: str, timeout_s: float = 1.0, motor: type[VescEmulator] = VescEmulator,
    program: str = "wallride",
) -> AsyncIterator[Bench]:  # fmt: skip
    """Start everything; the runtime is killed and the devices are closed on every way out."""
    vesc = motor(tmp_path / "vesc", timeout_s=timeout_s, remember=100_000)
    vesc.start()
    scip = ScipEmulator()
    port = await scip.start_tcp()
    car = Bench(scip, vesc)
    car.lidar_port = port
    # The scans here do not move with the car, which only the report's laws do not mind.
    laws = ["wall_follow.method=report", "safety.method=report", "telemetry.enabled=false"]
    own = "own." if any(one.startswith("lidar.driver=") for one in assignments) else ""
    addresses = [f"lidar.{own}address=tcp://127.0.0.1:{port}"] if "lidar.driver=topic" not in assignments else []
    addresses.append(f"motor.address=serial://{tmp_path / 'vesc'}")
    car.runtime = RuntimeProcess(
        ROOT / "config" / "sim.toml", [*laws, *addresses, *assignments], program=(sys.executable, "-m", program)
    )
    turning = asyncio.create_task(car.turn())
    try:
        await car.runtime.start()
        yield car
    finally:
        turning.cancel()
        car.runtime.kill()
        await car.runtime.wait()
        scip.close()
        vesc.close()
