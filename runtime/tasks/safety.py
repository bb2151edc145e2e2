"""Says after every scan how fast the car may go."""

from collections.abc import Callable
from typing import Never

from drivers.api import Motor, Scan
from runtime.command import CapWord, Source
from runtime.control.guidance import Guard, Verdict
from runtime.queues import Inbox
from runtime.voices import Voices


async def watch(
    scans: Inbox[Scan],
    motor: Motor,
    guard: Guard,
    voices: Voices,
    *,
    expires_after_s: float,
    publish: Callable[[Scan, Verdict], None],
) -> Never:
    """Judge each scan; the verdict is in force only so long after the scan, so a blind safety is a silent one."""
    while True:
        scan = await scans.get()
        verdict = guard.judge(scan, motor.state)
        word = CapWord(
            Source.SAFETY, verdict.forward_mps, verdict.reverse_mps, scan.stamp_s, verdict.reason, verdict.measure
        )
        voices.say(word, expires_at_s=scan.stamp_s + expires_after_s)
        publish(scan, verdict)
