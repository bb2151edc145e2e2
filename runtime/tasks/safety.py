"""Says after every scan how fast the car may go."""

from collections.abc import Callable
from typing import Never

from drivers.api import Motor, MotorState, Scan
from runtime.arbitration.queues import Inbox
from runtime.realtime.stage_timing import TimedStage

Look = Callable[[Scan, MotorState | None], object]
"""Takes in one scan and puts safety's word into the command queue: `LiveStack.look`."""


async def watch(scans: Inbox[Scan], motor: Motor, look: Look, stage: TimedStage) -> Never:
    """Take in each scan."""
    while True:
        scan = await scans.get()
        stage.begin()
        look(scan, motor.state)
        stage.end()
