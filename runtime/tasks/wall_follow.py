"""Follows the wall: one navigation word per scan."""

from collections.abc import Callable
from typing import Never

from drivers.api import Drive, Motor, Scan
from runtime.arbitration.command import DriveWord, Source
from runtime.arbitration.command_queue import Voices
from runtime.arbitration.queues import Inbox
from runtime.control.guidance import Follower, Guidance
from runtime.realtime.stage_timing import Stage


async def follow(
    scans: Inbox[Scan],
    motor: Motor,
    follower: Follower,
    voices: Voices,
    *,
    expires_after_s: Callable[[], float],
    publish: Callable[[Scan, Guidance], None],
    decide: Callable[[], None] = lambda: None,
    afterwards: Callable[[Scan], None] = lambda _: None,
    stage: Stage | None = None,
) -> Never:
    """Answer each scan; a follower without an answer asks for standstill, with its reason.

    decide: called when all has been said about a scan, so that the motor need not wait for the mux's turn.
    afterwards: told of the scan when its answer is on its way.
    """
    stage = stage or Stage(lambda: 0.0)
    while True:
        scan = await scans.get()
        stage.begin()
        guidance = follower.follow(scan, motor.state)
        drive = guidance.drive if guidance.drive is not None else Drive(0.0, 0.0)
        word = DriveWord(Source.NAVIGATION, drive, scan.stamp_s, guidance.reason)
        voices.say(word, expires_at_s=scan.stamp_s + expires_after_s())
        stage.end()
        decide()
        publish(scan, guidance)
        afterwards(scan)
