"""A car that only exists as what telemetry looks at: two twins, some commands, a clock set by hand."""

import math

from wallride.drivers.api import Drive, LinkState, Scan
from wallride.runtime.arbitration.command import (
    LAB_ORDER,
    Decision,
    DriveCommand,
    Output,
    Source,
    SpeedLimit,
    Verdict,
    consent,
    refusal,
)
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.telemetry.status import ObservedState
from wallride.runtime.wire import topics
from wallride.sim.virtual.devices import STEP_RAD, MemoryLidar, MemoryMotor, ranges_between_walls

RANGES_M = ranges_between_walls(1.0, 1.0)
GUIDANCE = Guidance(Drive(1.0, 0.1), 1.1, 0.125, 0.05, "wall")


class HandClock:
    def __init__(self, now_s=100.0):
        self.now_s = now_s

    def __call__(self):
        return self.now_s


def make_observed(clock, **more):
    motor = MemoryMotor(clock)
    lidar = MemoryLidar(lambda _: None, clock)
    queue = CommandQueue(LAB_ORDER, clock)
    return ObservedState(
        car="car1", version="9.9", lidar=lidar, motor=motor, queue=queue, clock=clock,
        seconds_by_winner={"navigation": 3.5}, **more,
    )  # fmt: skip


def scan_at(stamp_s, ranges_m=RANGES_M):
    return Scan(stamp_s, stamp_s + 0.001, -STEP_RAD * 540, STEP_RAD, 0.02, 30.0, ranges_m, 0)


def speak(observed, *, speed_mps=1.0, safety=None, permit=True):
    """Let navigation, safety and the permit speak now."""
    now_s = observed.clock()
    verdict = safety or Verdict(math.inf, math.inf, "clear")
    observed.queue.put(SpeedLimit(Source.SAFETY, verdict, now_s))
    observed.queue.put(consent(Source.PERMIT, "yes") if permit else refusal(Source.PERMIT, "no permit"))
    observed.queue.put(DriveCommand(Source.NAVIGATION, Drive(speed_mps, 0.1), now_s, "wall"))


def output_of(observed, *, speed_mps=1.0, winner=Source.NAVIGATION, reason="wall", measure=math.nan, sent_mps=None):
    decision = Decision(speed_mps, 0.1, Source.NAVIGATION, winner, reason, measure)
    sent_mps = speed_mps if sent_mps is None else sent_mps
    return Output(observed.clock(), Drive(sent_mps, 0.1), decision, delivered=True)


def lose(device, message="cable"):
    device.health.link, device.health.message = LinkState.ABSENT, message


SILENT = {topics.TELEOP, topics.JOY, topics.IMU, topics.POSE, *topics.LASTING}
"""Topics of which the car of these tests has no value: no operator, no inertial sensor, no map."""


def check_told(told):
    """Fail where the topics that a car told are not all but the silent ones; say what to do."""
    lacking = sorted(topics.TELEMETRY.keys() - SILENT - told)
    assert not lacking, (
        f"nothing was told on {lacking}: enter it in _writers of runtime/telemetry/topic_writers.py, let its event in"
        " runtime/tasks/telemetry.py note a value, or name it in SILENT of tests/runtime/observed.py"
    )
    assert not told & SILENT, f"take {sorted(told & SILENT)} out of SILENT in tests/runtime/observed.py"
    assert told <= topics.TELEMETRY.keys()
