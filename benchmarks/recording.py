"""What recording costs: processor time, and time between a scan and the motor.

    python benchmarks/recording.py [--rounds 6] [--seconds 10] [--folder DIR] [--disk-mbps MB/S]
                                   [--unpaced] [--switch-interval S]

One event loop runs the car's own tasks (both laws, mux at 50 Hz ticks, telemetry) on a lidar of 40 noisy scans a second
and a motor in memory. Rounds with the recorder and rounds without alternate, so that a busy machine is as unfair to one
as to the other. "late" is how long after its due time a scan is delivered (what the recorder's thread may add when it
holds Python's lock), "answer" is from its delivery to the motor's command, "both" is their sum.
"""

import argparse
import asyncio
import gc
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Never

import numpy as np

from wallride.drivers.api import Health, LinkState, MotorState, Scan
from wallride.runtime.arbitration.command import Output, Source, consent
from wallride.runtime.arbitration.inbox import Inbox
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.ending import end
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.realtime.periodic import PeriodicTimer
from wallride.runtime.realtime.stage_timing import StageTimer
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording import recorder
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.recorder import Recorder
from wallride.runtime.rehearsal import Rehearsal
from wallride.runtime.settings.recording import RecordingSettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks import lidar as lidar_task
from wallride.runtime.tasks import mux as mux_task
from wallride.runtime.tasks import safety, wall_follow
from wallride.runtime.tasks.scan_cycle import ScanCycle
from wallride.runtime.tasks.telemetry import Telemetry
from wallride.runtime.telemetry.status import ObservedState
from wallride.sim.virtual.devices import BEAMS, STEP_RAD, MemoryMotor, ranges_between_walls

RATE_HZ = 40.0
SETTLING_SCANS = 20
LATE_S = 0.005
PERCENTILES = (50, 90, 99, 99.9)
WALLS_M = ranges_between_walls(0.9, 1.1, 8.0)


class SteadyLidar:
    """Delivers a scan at every due time and never catches up on a late one. late_s: delay of each."""

    def __init__(self, clock: Callable[[], float]) -> None:
        noise = np.random.default_rng(1)
        self._scans_m = [(WALLS_M + noise.normal(0, 0.01, BEAMS)).astype(np.float32) for _ in range(64)]
        self._clock = clock
        self.health = Health(LinkState.READY, "in memory", "bench")
        self.due_s: dict[int, float] = {}
        self.delivered_s: dict[int, float] = {}

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver until cancelled."""
        sequence, due_s = 0, self._clock() + 0.1
        while True:
            await asyncio.sleep(max(0.0, due_s - self._clock()))
            now_s = self._clock()
            self.due_s[sequence], self.delivered_s[sequence] = due_s, now_s
            ranges_m = self._scans_m[sequence % len(self._scans_m)]
            on_scan(Scan(now_s, now_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, ranges_m, sequence))
            sequence += 1
            due_s += (int((self._clock() - due_s) * RATE_HZ) + 1) / RATE_HZ


class SlowDisk(Disk):
    """Limits writes to a number of bytes per second."""

    def __init__(self, bytes_per_s: float) -> None:
        self._bytes_per_s = bytes_per_s

    def write(self, descriptor: int, data: memoryview) -> int:
        """Write, in the time that such a disk needs."""
        time.sleep(len(data) / self._bytes_per_s)
        return super().write(descriptor, data)


class Bench:
    """One car without wheels. answered_s: when the motor had its answer to a scan."""

    def __init__(self, folder: Path | None, disk: Disk) -> None:
        clock = time.monotonic
        settings = Settings()
        self.recorder = Recorder(
            RecordingSettings(folder=str(folder or "."), start="always", enabled=folder is not None, keep_free_mb=0),
            car="bench", version="0", wall_clock=WallClock(clock), clock=clock, disk=disk,
        )  # fmt: skip
        decision_log = self.recorder.decision_log if folder is not None else DecisionLog(clock, 0)
        self.lidar, self.motor = SteadyLidar(clock), MemoryMotor(clock)
        self.stack = LiveStack(settings, decision_log)
        self.queue = self.stack.queue
        self.stages = StageTimer(clock)
        self.mux = mux_task.Mux(
            self.queue, self.motor, self.stack.limiter, REQUIRED, decision_log.clock, self.stages, decision_log
        )
        observed = ObservedState(
            car="bench", version="0", lidar=self.lidar, motor=self.motor, queue=self.queue, clock=clock,
            seconds_by_winner=self.mux.seconds_by_winner, window=lambda: self.stack.laws.words,
        )  # fmt: skip
        sinks = [self.recorder] if folder is not None else []
        self.telemetry = Telemetry(
            observed, settings.car, sinks, wall_clock=WallClock(lambda: 0.0, lambda: 0), side=lambda: "left"
        )
        self.answered_s: dict[int, float] = {}
        self._clock = clock
        self._decision_log = decision_log
        self._unanswered: int | None = None

    async def drive(self, seconds: float) -> None:
        """Drive for a duration."""
        for_safety: Inbox[Scan] = Inbox()
        for_follower: Inbox[Scan] = Inbox()
        self.queue.put(consent(Source.PERMIT, "bench"))

        def answer(scan: Scan, state: MotorState | None) -> Guidance:
            self._unanswered = scan.sequence
            return self.stack.follow(scan, state)

        def learn(_: Scan) -> None:
            self.stack.laws.learn()
            self.stages.count()

        cycle = ScanCycle(self.stages.follow, self.mux.decide_now, self.telemetry.on_guidance, [learn])
        timer = PeriodicTimer(self._clock)
        timer.every(0.02, mux_task.SilenceTick(self.queue, 50.0, self._clock).tick)
        jobs = (
            lidar_task.pump(
                self.lidar, [self._decision_log.add_scan, self.telemetry.on_scan, for_safety.put, for_follower.put]
            ),
            safety.watch(for_safety, self.motor, self.stack.look, self.stages.safety),
            wall_follow.follow(for_follower, self.motor, answer, cycle),
            self.mux.run(self._on_output),
            timer.run(),
            self.telemetry.run(),
        )  # fmt: skip
        tasks = [asyncio.create_task(job) for job in jobs]
        await asyncio.sleep(seconds)
        await end(*tasks)

    def _on_output(self, output: Output) -> None:
        if self._unanswered is not None:
            self.answered_s[self._unanswered] = self._clock()
            self._unanswered = None
        self.telemetry.on_output(output)

    def figures_s(self) -> dict[str, list[float]]:
        """Return lateness, answer time and their sum of every answered scan but the first ones."""
        lidar = self.lidar
        answered = [number for number in self.answered_s if number >= SETTLING_SCANS]
        return {
            "late": [lidar.delivered_s[number] - lidar.due_s[number] for number in answered],
            "answer": [self.answered_s[number] - lidar.delivered_s[number] for number in answered],
            "both": [self.answered_s[number] - lidar.due_s[number] for number in answered],
        }


def run_round(folder: Path | None, seconds: float, disk: Disk) -> tuple[dict[str, list[float]], float, float]:
    """Return figures, processor time per second of driving, and the part of the recorder's thread in it."""
    bench = Bench(folder, disk)
    gc.collect()
    gc.freeze()
    if folder is not None:
        bench.recorder.start()
    began_s, used_s = time.monotonic(), time.process_time()
    asyncio.run(bench.drive(seconds))
    used_s, took_s = time.process_time() - used_s, time.monotonic() - began_s
    thread_s = bench.recorder.processor_s
    if lost := bench.recorder.status()["lost"]:
        print(f"{lost} messages lost: {bench.recorder.status()['words']}")
    bench.recorder.close(5.0)
    gc.unfreeze()
    return bench.figures_s(), used_s / took_s, thread_s / took_s


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--disk-mbps", type=float, metavar="MB/S", help="a disk that takes no more")
    parser.add_argument("--unpaced", action="store_true", help="let the recorder's thread work without pauses")
    parser.add_argument("--switch-interval", type=float, default=sys.getswitchinterval())
    options = parser.parse_args()
    sys.setswitchinterval(options.switch_interval)
    if options.unpaced:
        recorder.WORK_S = 1e9
    disk = SlowDisk(1e6 * options.disk_mbps) if options.disk_mbps else Disk()
    folder = Path(tempfile.mkdtemp(prefix="wallride-bench-", dir=options.folder))
    settings = Settings()
    Rehearsal(settings, time.monotonic).warm_up()
    run_round(folder, 2.0, disk)
    run_round(None, 2.0, disk)
    figures, used, by_thread = measured(folder, options.rounds, options.seconds, disk)
    shutil.rmtree(folder)
    show(figures, used, by_thread)


def measured(
    folder: Path, rounds: int, seconds: float, disk: Disk
) -> tuple[dict[bool, dict[str, list[float]]], dict[bool, list[float]], list[float]]:
    """Return samples by stage and shares of a core, with and without recording by turns, and its thread's share."""
    figures: dict[bool, dict[str, list[float]]] = {True: {}, False: {}}
    used: dict[bool, list[float]] = {True: [], False: []}
    by_thread: list[float] = []
    for number in range(2 * rounds):
        recorded = number % 2 == 0
        found, share, thread_share = run_round(folder if recorded else None, seconds, disk)
        used[recorded].append(share)
        if recorded:
            by_thread.append(thread_share)
        for name, samples_s in found.items():
            figures[recorded].setdefault(name, []).extend(samples_s)
    return figures, used, by_thread


def show(figures: dict[bool, dict[str, list[float]]], used: dict[bool, list[float]], by_thread: list[float]) -> None:
    """Print the table and what recording costs."""
    for recorded in (False, True):
        print(
            f"{'with' if recorded else 'without'} recording: {100 * float(np.median(used[recorded])):.2f} % of a core"
        )
        for name, samples_s in figures[recorded].items():
            spread = ", ".join(f"p{p:g} {1000 * np.percentile(samples_s, p):.3f}" for p in PERCENTILES)
            late = sum(sample_s > LATE_S for sample_s in samples_s)
            more = f"max {1000 * max(samples_s):.3f} ms, {late} of {len(samples_s)} over {1000 * LATE_S:.0f} ms"
            print(f"  {name:<7} {spread}, {more}")
    cost = float(np.median(used[True])) - float(np.median(used[False]))
    print(
        f"recording costs {100 * cost:.2f} % of a core, {100 * float(np.median(by_thread)):.2f} % of it in its thread"
    )


if __name__ == "__main__":
    main()
