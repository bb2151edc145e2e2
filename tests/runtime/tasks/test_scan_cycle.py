"""A scan ends in one order: the motor's command first, and nothing that can wait before it."""

import numpy as np

from tests.runtime.observed import GUIDANCE
from wallride.drivers.api import Scan
from wallride.runtime.realtime.stage_timing import TimedStage
from wallride.runtime.tasks.scan_cycle import ScanCycle


def test_the_motor_has_its_command_before_telemetry_and_learning():
    done: list[object] = []
    clock_s = iter((1.0, 1.25))
    stage = TimedStage(lambda: next(clock_s))
    cycle = ScanCycle(
        stage,
        lambda: done.append("decide"),
        lambda scan, guidance: done.append(("publish", scan.sequence, guidance)),
        [lambda _: done.append("learn"), lambda scan: done.append(("count", scan.sequence))],
    )
    cycle.begin()
    cycle.end(Scan(0.0, 0.0, -1.0, 0.1, 0.02, 30.0, np.ones(20, np.float32), 7), GUIDANCE)
    assert done == ["decide", ("publish", 7, GUIDANCE), "learn", ("count", 7)]
