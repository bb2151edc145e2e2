"""Says after every scan how fast the car may go."""

from collections.abc import Callable
from typing import Never

from drivers.api import Motor, Scan
from runtime.arbitration.command import CapWord, Source
from runtime.arbitration.command_queue import Voices
from runtime.arbitration.queues import Inbox
from runtime.control.guidance import Guard
from runtime.realtime.stage_timing import Stage


async def watch(
    scans: Inbox[Scan],
    motor: Motor,
    guard: Guard,
    voices: Voices,
    *,
    expires_after_s: Callable[[], float],
    stage: Stage | None = None,
) -> Never:
    """Take in each scan; the outlook is in force only so long after the scan, so a blind safety is a silent one.

    What is said is not a number but a judge: the mux asks it about the very drive that is about to be sent.
    """
    stage = stage or Stage(lambda: 0.0)
    while True:
        scan = await scans.get()
        stage.begin()
        word = CapWord(Source.SAFETY, guard.look(scan, motor.state), scan.stamp_s)
        voices.say(word, expires_at_s=scan.stamp_s + expires_after_s())
        stage.end()
