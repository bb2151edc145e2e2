"""The safety task: limits the speed after every scan."""

from collections.abc import Callable
from typing import Never

from wallride.drivers.api import Motor, MotorState, Scan
from wallride.runtime.arbitration.inbox import Inbox
from wallride.runtime.realtime.stage_timing import TimedStage

Look = Callable[[Scan, MotorState | None], object]
"""Takes in one scan and puts safety's speed limit into the command queue: `LiveStack.look`."""


async def watch(scans: Inbox[Scan], motor: Motor, look: Look, stage: TimedStage) -> Never:
    """Take in each scan."""
    while True:
        scan = await scans.get()
        stage.begin()
        look(scan, motor.state)
        stage.end()
