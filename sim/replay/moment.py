"""Why the car drove as it did at one scan of its own recording: the follower's answer and the mux's decision on it."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

from wallride.runtime.arbitration.command import NO_WINNER, Output
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.decision_log import DecisionEvent, Event, FollowerEvent, ScanEvent
from wallride.runtime.telemetry.screen_words import because, steering_words
from wallride.runtime.wire import topics
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import DriveLog
from wallride.sim.replay.faults import faults_in
from wallride.sim.replay.reenact import duration_s, events_of, first_time_s

LATE_S = 0.2
"""A time asked for that is so much later than the newest answered scan is told."""
AROUND_S = 0.5
"""Time around a scan in which faults are told beside it."""

ROUNDING_S = 0.001
"""The end is printed in milliseconds; typed as printed, it is in the recording."""
MIN_SHOWN_MPS = 0.005


@dataclass(frozen=True, slots=True)
class Moment:
    """One answered scan. time_s: since the decision log began. output: the next decision; None where none follows.

    then: decisions for another reason before the next answer, as of a scan that grew too old. asked_s: the time asked
    for, where it is later than the next scan would be; NaN else. faults: what went wrong from just before the scan on,
    with its time.
    """

    scan: int
    time_s: float
    answer: Guidance
    output: Output | None
    asked_s: float = math.nan
    faults: Sequence[tuple[float, str]] = ()
    then: Sequence[Output] = ()

    def lines(self) -> list[str]:
        """Return what is shown of it."""
        late = f": no later scan was answered before {self.asked_s:.3f} s" if math.isfinite(self.asked_s) else ""
        said = [f"scan {self.scan}, {self.time_s:.3f} s{late}", f"  follower  {_asked(self.answer)}"]
        troubles = [f"  fault     {time_s:.3f} s: {words}" for time_s, words in self.faults]
        if self.output is None:
            return [*said, "  the recording ends before a decision on it", *troubles]
        decision = self.output.decision
        said.append(f"  decided   {_decided(self.output)}")
        if decision.driver is not None and decision.driver != decision.winner:
            said.append(f"            the drive is of {decision.driver}")
        sent = self.output.drive
        words = [_speed(sent.speed_mps), steering_words(sent.steering_rad)]
        words += ["a brake in its place"] * self.output.braked + ["not delivered"] * (not self.output.delivered)
        later = [
            f"  then      {output.stamp_s - self.output.stamp_s:.3f} s later {_decided(output)}" for output in self.then
        ]
        return [*said, f"  sent      {', '.join(filter(None, words))}", *later, *troubles]

    def as_plain(self) -> dict[str, Any]:
        """Return it as plain data for programs."""
        drive, output = self.answer.drive, self.output
        return {
            "scan": self.scan,
            "time_s": self.time_s,
            "follower": {
                "speed_mps": None if drive is None else drive.speed_mps,
                "steering_rad": None if drive is None else drive.steering_rad,
                "reason": self.answer.reason,
            },
            "decision": None if output is None else _plain(output),
            "then": [_plain(one) for one in self.then],
            "sent": None if output is None else {
                "speed_mps": output.drive.speed_mps,
                "steering_rad": output.drive.steering_rad,
                "delivered": output.delivered,
                "braked": output.braked,
            },
            "faults": [{"time_s": time_s, "words": words} for time_s, words in self.faults],
        }  # fmt: skip


def moment_at_scan(log: DriveLog, scan: int) -> Moment:
    """Return a scan by its number; RecordingError with its neighbours where the follower has not answered it."""
    events = events_of(log)
    answered = _answered(log, events)
    at = bisect_left([event.sequence for event in answered], scan)
    if at < len(answered) and answered[at].sequence == scan:
        return _moment(log, events, answered[at])
    around = " and ".join(str(event.sequence) for event in answered[max(0, at - 1) : at + 1])
    raise RecordingError(
        f"{log.name}: the follower has not answered scan {scan} (lost, overtaken, or before or after this file);"
        f" the nearest: {around}. It has scans {answered[0].sequence} to {answered[-1].sequence}."
    )


def moment_at_time(log: DriveLog, time_s: float) -> Moment:
    """Return the newest scan that was answered at a time after the decision log began, or the first one.

    RecordingError with the recording's range for a time that is not in it.
    """
    events = events_of(log)
    ends_s = duration_s(events)
    if not 0.0 <= time_s <= ends_s + ROUNDING_S:  # NaN is nowhere
        raise RecordingError(f"{log.name}: {time_s:g} s is not in it: give a time from 0 to {ends_s:.3f} s.")
    answered, came_s = _answered(log, events), _times_s(events)
    newest = max((at for at, event in enumerate(answered) if came_s[event.sequence] <= time_s), default=0)
    return _moment(log, events, answered[newest], time_s)


def _answered(log: DriveLog, events: Sequence[Event]) -> list[FollowerEvent]:
    came_s = _times_s(events)
    answered = [event for event in events if isinstance(event, FollowerEvent) and event.sequence in came_s]
    if not answered:
        raise RecordingError(f"{log.name}: the follower has answered no scan in it.")
    return sorted(answered, key=lambda event: event.sequence)


def _times_s(events: Sequence[Event]) -> dict[int, float]:
    """Return when each scan came, since the decision log began."""
    zero_s = first_time_s(events)
    return {event.sequence: event.received_s - zero_s for event in events if isinstance(event, ScanEvent)}


def _moment(log: DriveLog, events: Sequence[Event], answer: FollowerEvent, asked_s: float = math.nan) -> Moment:
    later = (event.output for event in events if event.number > answer.number and isinstance(event, DecisionEvent))
    output = next(later, None)
    before_next = takewhile(
        lambda event: not isinstance(event, FollowerEvent), (event for event in events if event.number > answer.number)
    )
    time_s = _times_s(events)[answer.sequence]
    is_late = asked_s > time_s + LATE_S
    until_s = asked_s if is_late else time_s + AROUND_S
    faults = _faults(log, answer.sequence, time_s, until_s)
    then = _changes([event.output for event in before_next if isinstance(event, DecisionEvent)])
    return Moment(answer.sequence, time_s, answer.guidance, output, asked_s if is_late else math.nan, faults, then)


def _changes(outputs: Sequence[Output]) -> list[Output]:
    """Return the decisions that have another winner or reason than the one before."""
    minds = [(output.decision.winner, output.decision.reason) for output in outputs]
    return [output for output, mind, before in zip(outputs[1:], minds[1:], minds, strict=False) if mind != before]


def _decided(output: Output) -> str:
    decision = output.decision
    reason = because(decision.reason, decision.measure)
    return f"{decision.winner or NO_WINNER}: {_speed(decision.speed_mps)}: {reason}"


def _plain(output: Output) -> dict[str, Any]:
    decision = output.decision
    return {
        "winner": decision.winner,
        "driver": decision.driver,
        "speed_mps": decision.speed_mps,
        "reason": decision.reason,
        "measure": decision.measure if math.isfinite(decision.measure) else None,
    }


def _faults(log: DriveLog, scan: int, time_s: float, until_s: float) -> list[tuple[float, str]]:
    """Return what went wrong from just before a scan until a time; times on the decision log's clock."""
    came_ns = next((message.stamp_ns for message in log.of(topics.SCAN) if message.sequence == scan), None)
    if came_ns is None:
        return []
    times = [(round(time_s + (fault.stamp_ns - came_ns) / NS, 3), fault.words) for fault in faults_in(log)]
    return [(at_s, words) for at_s, words in times if time_s - AROUND_S <= at_s <= until_s]


def _asked(answer: Guidance) -> str:
    if answer.drive is None:
        return f"no drive: {answer.reason}"
    words = [_speed(answer.drive.speed_mps), steering_words(answer.drive.steering_rad)]
    return f"{', '.join(filter(None, words))}: {answer.reason}"


def _speed(speed_mps: float) -> str:
    return f"{speed_mps if abs(speed_mps) >= MIN_SHOWN_MPS else 0.0:.2f} m/s"
