"""A soak in real time: the unmodified `wallride run` process between emulated devices, faults injected on the wire.

The oracle judges what arrives at the emulated motor. The times of this process count: what its own loop was late is
added to each bound, and the longest is reported.
"""

import asyncio
import contextlib
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Final

from tests.system.bench import ROOT
from tests.system.soak.findings import Findings, Resources
from tests.system.soak.oracle import Oracle, Promises
from tests.system.soak.scene import WIRING, ListeningVesc, Scene
from tests.system.soak.surroundings import (
    AUTO_MPS,
    FIRST_FAULT_S,
    VESC_TIMEOUT_A,
    VESC_TIMEOUT_S,
    SoakSurroundings,
)
from wallride.runtime.host.scheduling import PRIORITY_VARIABLE
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.live.runtime_process import RuntimeProcess

PROMISES: Final = Promises(
    obeyed_s=0.1, tick_s=0.05, scan_s=0.15, silence_s=0.25, slack_s=0.05, auto_mps=AUTO_MPS, stuck_s=120.0
)
"""Those of docs/faults.md on the wire: 0.25 s for anything that ends good data."""
SETTLED_S: Final = 180.0
"""Time after which memory counts: caches, the black box and the allocator have their size."""
STARTS_WITHIN_S: Final = 120.0
SAMPLE_S: Final = 10.0
TELL_S: Final = 60.0
LATE_FORGOTTEN_S: Final = 2.0
CAR: Final = "sim"


class RealSoak(SoakSurroundings):
    """One process in its surroundings."""

    def __init__(self, folder: Path, seed: int, mean_pause_s: float) -> None:
        self._folder = folder
        lidar = ScipEmulator(seed=seed)
        vesc = ListeningVesc(folder / "vesc", timeout_s=VESC_TIMEOUT_S, timeout_brake_a=VESC_TIMEOUT_A, remember=1)
        super().__init__(time.monotonic, lidar, vesc, _oracle, seed, mean_pause_s)
        self.oracle.context = lambda: f"[{', '.join(self.injector.active)}; {self.oracle.late_s * 1000:.0f} ms late]"
        vesc.witness = self._witness
        self.resources = Resources()
        self.longest_late_s = 0.0
        self._late_until_s = 0.0
        self._rules_told = 0
        self._stopped_s: float | None = None
        self._stopped_until_s = 0.0
        self._sample_s, self._tell_s = SETTLED_S, TELL_S
        self._bus: Bus | None = None
        self.runtime: RuntimeProcess

    def _witness(self, at_s: float, payload: bytes) -> None:
        self._note_lateness(at_s)
        self.oracle.motor(at_s, payload)

    def _note_lateness(self, now_s: float) -> None:
        if now_s > self._late_until_s:
            self.oracle.late_s = 0.0

    def carry(self, payload: bytes) -> None:
        """Publish it, as a client does."""
        if self._bus is not None:
            self._bus.put(topics.key(CAR, topics.COMMAND), payload, encoding=BYTES, urgent=True)

    def block(self, for_s: float) -> None:
        """Stop the whole process for a time."""
        self.runtime.kill(signal.SIGSTOP)
        self._stopped_s = self._clock()
        self._stopped_until_s = self._stopped_s + for_s

    def _go_on(self, now_s: float) -> None:
        self.runtime.kill(signal.SIGCONT)
        if self._stopped_s is not None:
            self.oracle.blocked(now_s, now_s - self._stopped_s)
            self._stopped_s = None

    def _step(self, now_s: float, elapsed_s: float, tell: Callable[[str], None]) -> None:
        """Begin and end faults, and take samples."""
        if self._stopped_s is not None and now_s >= self._stopped_until_s:
            self._go_on(now_s)
        if elapsed_s > FIRST_FAULT_S:
            self.injector.step(now_s)
        self.oracle.idle(now_s)
        if elapsed_s >= self._sample_s and not self.injector.active:
            self._sample_s = elapsed_s + SAMPLE_S
            self.resources.sample(self.runtime.pid)
        if len(self.oracle.violations) > self._rules_told:
            self._rules_told = len(self.oracle.violations)
            tell(self.oracle.kept[-1] if self.oracle.kept else "")
        if elapsed_s >= self._tell_s:
            self._tell_s += TELL_S
            tell(self._line(elapsed_s))

    async def run(self, seconds: float, tell: Callable[[str], None] = lambda _line: None) -> Findings:
        """Drive for so long; tell: gets a line now and then."""
        clock = self._clock
        async with AsyncExitStack() as stack:
            await self._start(stack)
            async with asyncio.TaskGroup() as tasks:
                jobs = [
                    tasks.create_task(self.turn_lidar()),
                    tasks.create_task(self.operate()),
                    tasks.create_task(self._watch_own_loop()),
                ]
                began_s = self.oracle.last_moved_s = clock()
                while (now_s := clock()) < began_s + seconds and self.runtime.exit_code is None:
                    await asyncio.sleep(0.01)
                    self._step(now_s, now_s - began_s, tell)
                self._go_on(clock())
                self.oracle.ending = True
                self.injector.end_all(clock())
                if self.runtime.exit_code is not None:
                    self.fault("the car ended by itself", f"exit code {self.runtime.exit_code}", *self.runtime.log)
                elif await self.runtime.stop() != 0:
                    self.fault("the car did not end in order")
                for job in jobs:
                    job.cancel()
        return self.findings(seconds)

    async def _start(self, stack: AsyncExitStack) -> None:
        endpoint = free_endpoint()
        self.vesc.start()
        stack.callback(self.vesc.close)
        port = await self.lidar.start_tcp()
        stack.callback(self.lidar.close)
        settings = [
            f"lidar.address=tcp://127.0.0.1:{port}",
            f"motor.address=serial://{self._folder / 'vesc'}",
            f"motor.servo_min={WIRING.servo_min}",
            f"motor.servo_max={WIRING.servo_max}",
            f"wall_follow.speed_mps={AUTO_MPS}",
            "operator.permit=required",
            "battery.settle_s=2",
            f"telemetry.listen={endpoint}",
            f"recording.folder={self._folder / 'recordings'}",
            "recording.ring_mb=64",
            "recording.file_mb=8",  # its index grows with a file: several whole files before the first sample
        ]
        os.environ[PRIORITY_VARIABLE] = "20"  # as its unit does
        self.runtime = RuntimeProcess(
            ROOT / "config" / "sim.toml", settings, program=(sys.executable, "-m", "tests.system.socket_motor")
        )
        await self.runtime.start()
        stack.push_async_callback(self.runtime.end)
        bus = Bus(zenoh_config.client_config(endpoint, None))
        bus.subscribe(topics.key(CAR, topics.BEAT), lambda _key, payload, _at_s: self.hear(payload))
        async with asyncio.timeout(STARTS_WITHIN_S):
            while not bus.is_open:
                try:
                    await bus.open()
                except OSError:
                    await asyncio.sleep(0.1)
        stack.push_async_callback(bus.close)
        self._bus = bus

    async def _watch_own_loop(self) -> None:
        """Note how late this process's own loop is: what it measures is late by as much."""
        while True:
            due_s = self._clock() + 0.005
            await asyncio.sleep(0.005)
            now_s = self._clock()
            late_s = now_s - due_s
            if late_s > 0.005:
                self.oracle.late_s = max(self.oracle.late_s, late_s)
                self._late_until_s = now_s + LATE_FORGOTTEN_S
                self.longest_late_s = max(self.longest_late_s, late_s)
            else:
                self._note_lateness(now_s)

    def _line(self, elapsed_s: float) -> str:
        oracle, resources = self.oracle, self.resources
        memory = "-"
        if resources.memory_bytes:
            memory = f"{resources.memory_bytes[-1] / 2**20:.1f} MiB (own {resources.own_bytes[-1] / 2**20:.1f})"
        descriptors = resources.descriptors[-1] if resources.descriptors else "-"
        return (
            f"{elapsed_s:6.0f} s  {oracle.commands} commands, {oracle.moving} moving, "
            f"{sum(self.injector.counts.values())} faults, {sum(oracle.violations.values())} violations, "
            f"{self.scene.way_m:.0f} m, {memory}, {descriptors} descriptors, {self.longest_late_s * 1000:.0f} ms late"
        )


def _oracle(scene: Scene) -> Oracle:
    return Oracle(PROMISES, lambda: scene.good_scan_s)


def schedule_devices() -> None:
    """Give this process FIFO scheduling above the car's where that is allowed: in a car they are other machines."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(30))


def soak_in_real_time(
    seconds: float, seed: int, mean_pause_s: float, tell: Callable[[str], None]
) -> tuple[Findings, Resources, float]:
    """Run one soak; return findings, resources and the longest lateness of this process [s]."""

    async def main() -> tuple[Findings, Resources, float]:
        schedule_devices()
        with tempfile.TemporaryDirectory(prefix="soak-") as folder:
            soak = RealSoak(Path(folder), seed, mean_pause_s)
            findings = await soak.run(seconds, tell)
            return findings, soak.resources, soak.longest_late_s

    return asyncio.run(main())
