"""Drives for recorders: the car's own laws and mux, a motor in memory, telemetry, and a clock set by hand."""

import asyncio
import math
from pathlib import Path

import numpy as np

from tests.runtime.observed import HandClock
from tests.runtime.recording.disks import QuickDisk
from wallride.drivers.api import Scan
from wallride.runtime.arbitration.command import LAB_ORDER, Source, consent, refusal
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording.recorder import Recorder
from wallride.runtime.settings.recording import RecordingSettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks.mux import Mux
from wallride.runtime.tasks.telemetry import Telemetry
from wallride.runtime.telemetry.status import ObservedState
from wallride.sim.virtual.devices import BEAMS, STEP_RAD, MemoryLidar, MemoryMotor, ranges_between_walls

EPOCH_NS = 1_790_000_000_000_000_000
PERIOD_S = 0.025
LIMITS = CarSettings(max_speed_mps=5.0, max_steering_rad=0.35, steering_rate_radps=6.0, max_acceleration_mps2=20.0)
RANGES_M = ranges_between_walls(0.9, 1.1)


async def driven(folder, seconds, **how):
    """Return a permitted drive that has gone for so long."""
    drive = Drive(folder, **how)
    drive.permit()
    await drive.go(seconds)
    return drive


class Drive:
    """A car on a desk. `go` lets time pass, and gives the recorder its turn ten times a second.

    period_s: from scan to scan.
    """

    def __init__(self, folder: Path, *, disk=None, seed=1, period_s=PERIOD_S, **settings):
        self.period_s = period_s
        self.clock = HandClock(100.0)
        self.clock_set_s = 0.0
        self.wall_clock = WallClock(self.clock, self.unix_ns)
        self.settings = Settings()
        self.recorder = Recorder(
            RecordingSettings(**{"folder": str(folder), "keep_free_mb": 0, **settings}),
            car="car1", version="9.9", wall_clock=self.wall_clock, clock=self.clock, disk=disk or QuickDisk(),
        )  # fmt: skip
        self.decision_log = decision_log = self.recorder.decision_log
        self.motor = MemoryMotor(self.clock)
        self.stack = LiveStack(self.settings, decision_log)
        self.queue = self.stack.queue
        self.queue.reorder(LAB_ORDER)
        self.mux = Mux(self.queue, self.motor, Limiter(LIMITS), REQUIRED, decision_log.clock)
        observed = ObservedState(
            car="car1", version="9.9", lidar=MemoryLidar(lambda _: None, self.clock), motor=self.motor,
            queue=self.queue, clock=self.clock, seconds_by_winner=self.mux.seconds_by_winner,
        )  # fmt: skip
        self.telemetry = Telemetry(
            observed, CarSettings(), [self.recorder], wall_clock=self.wall_clock, side=lambda: "left"
        )
        self.permitted = True
        self.outputs = []
        self.scans = []
        self._noise = np.random.default_rng(seed)
        self._stepped_s = self.clock.now_s
        self.recorder.listen()

    def unix_ns(self):
        """Return what the computer's clock says."""
        return EPOCH_NS + round((self.clock.now_s + self.clock_set_s) * 1e9)

    def scan(self, ranges_m=RANGES_M):
        """Let one scan go all the way to the motor."""
        noisy_m = (ranges_m + self._noise.normal(0, 0.01, BEAMS)).astype(np.float32)
        self.clock.now_s += 0.001
        scan = Scan(
            self.clock.now_s - 0.001, self.clock.now_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, noisy_m,
            len(self.scans),
        )  # fmt: skip
        self.scans.append(scan)
        self.decision_log.add_scan(scan)
        self.telemetry.on_scan(scan)
        state = self.motor.state
        self.stack.look(scan, state)
        guidance = self.stack.follow(scan, state)
        assert guidance.drive is not None
        self.telemetry.on_guidance(scan, guidance)
        self.step()

    def step(self):
        """Let the mux decide."""
        self.decision_log.begin()
        output = self.mux.step()
        self.decision_log.add_decision(output.stamp_s - self._stepped_s, self.queue.live(), output)
        self._stepped_s = output.stamp_s
        self.outputs.append(output)
        self.telemetry.on_output(output)

    def put(self, word, expires_at_s=math.inf):
        """Put a command; the decision log records it."""
        self.queue.put(word, expires_at_s=expires_at_s)

    def permit(self, yes=True):
        """Arm or disarm."""
        self.permitted = yes
        self.put(consent(Source.PERMIT, "yes") if yes else refusal(Source.PERMIT, "no operator permits autonomy"))

    async def go(self, seconds, *, write=True, ranges_m=RANGES_M, speak=True):
        """Drive for a while; the recorder has its turn every tenth of a second."""
        task = asyncio.create_task(self.telemetry.run())
        end_s = self.clock.now_s + seconds
        turn_s = self.clock.now_s
        while self.clock.now_s < end_s - 1e-9:
            if speak:
                self.scan(ranges_m)
            else:
                self.clock.now_s += 0.001
                self.step()
            for _ in range(40):
                await asyncio.sleep(0)
            self.clock.now_s += self.period_s - 0.001
            if write and self.clock.now_s >= turn_s + 0.1:
                turn_s = self.clock.now_s
                self.recorder.turn()
        task.cancel()
        await asyncio.wait([task])
