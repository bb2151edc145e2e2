"""The wall following task: one navigation command per scan, and then the end of the scan's cycle."""

from collections.abc import Callable
from typing import Never

from wallride.drivers.api import Motor, MotorState, Scan
from wallride.runtime.arbitration.inbox import Inbox
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.tasks.scan_cycle import ScanCycle

Follow = Callable[[Scan, MotorState | None], Guidance]
"""Answers one scan and puts the navigation command into the command queue: `LiveStack.follow`."""


async def follow(scans: Inbox[Scan], motor: Motor, answer: Follow, cycle: ScanCycle) -> Never:
    """Answer each scan; the cycle times the answer and ends the scan with it."""
    while True:
        scan = await scans.get()
        cycle.begin()
        guidance = answer(scan, motor.state)
        cycle.end(scan, guidance)
