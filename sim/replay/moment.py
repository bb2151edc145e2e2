"""Why the car drove as it did at one scan of its own recording: the follower's answer and the mux's decision on it."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from wallride.runtime.arbitration.command import NO_WINNER, Output
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.recording.decision_log import DecisionEvent, Event, FollowerEvent, ScanEvent
from wallride.runtime.telemetry.screen_words import because, steering_words
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import DriveLog
from wallride.sim.replay.reenact import events_of, first_time_s


@dataclass(frozen=True, slots=True)
class Moment:
    """One answered scan. time_s: since the decision log began. output: the next decision; None where none follows."""

    scan: int
    time_s: float
    answer: Guidance
    output: Output | None

    def lines(self) -> list[str]:
        """Return what is shown of it."""
        said = [f"scan {self.scan}, {self.time_s:.3f} s", f"  follower  {_asked(self.answer)}"]
        if self.output is None:
            return [*said, "  the recording ends before a decision on it"]
        decision = self.output.decision
        reason = because(decision.reason, decision.measure)
        said.append(f"  decided   {decision.winner or NO_WINNER}: {decision.speed_mps:.2f} m/s: {reason}")
        if decision.driver is not None and decision.driver != decision.winner:
            said.append(f"            the drive is of {decision.driver}")
        sent = self.output.drive
        words = [f"{sent.speed_mps:.2f} m/s", steering_words(sent.steering_rad)]
        words += ["a brake in its place"] * self.output.braked + ["not delivered"] * (not self.output.delivered)
        return [*said, f"  sent      {', '.join(filter(None, words))}"]

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
            "decision": None if output is None else {
                "winner": output.decision.winner,
                "driver": output.decision.driver,
                "speed_mps": output.decision.speed_mps,
                "reason": output.decision.reason,
                "measure": output.decision.measure if math.isfinite(output.decision.measure) else None,
            },
            "sent": None if output is None else {
                "speed_mps": output.drive.speed_mps,
                "steering_rad": output.drive.steering_rad,
                "delivered": output.delivered,
                "braked": output.braked,
            },
        }  # fmt: skip


def moment_at_scan(log: DriveLog, scan: int) -> Moment:
    """Return a scan by its number; RecordingError with its neighbours where the follower has not answered it."""
    events = events_of(log)
    answered = _answered(log, events)
    at = bisect_left([event.sequence for event in answered], scan)
    if at < len(answered) and answered[at].sequence == scan:
        return _moment(events, answered[at])
    around = " and ".join(str(event.sequence) for event in answered[max(0, at - 1) : at + 1])
    raise RecordingError(
        f"{log.name}: the follower has not answered scan {scan} (lost, overtaken, or before or after this file);"
        f" the nearest: {around}. It has scans {answered[0].sequence} to {answered[-1].sequence}."
    )


def moment_at_time(log: DriveLog, time_s: float) -> Moment:
    """Return the newest scan that was answered at a time after the decision log began, or the first one."""
    events = events_of(log)
    answered, came_s = _answered(log, events), _times_s(events)
    newest = max((at for at, event in enumerate(answered) if came_s[event.sequence] <= time_s), default=0)
    return _moment(events, answered[newest])


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


def _moment(events: Sequence[Event], answer: FollowerEvent) -> Moment:
    later = (event.output for event in events if event.number > answer.number and isinstance(event, DecisionEvent))
    return Moment(answer.sequence, _times_s(events)[answer.sequence], answer.guidance, next(later, None))


def _asked(answer: Guidance) -> str:
    if answer.drive is None:
        return f"no drive: {answer.reason}"
    words = [f"{answer.drive.speed_mps:.2f} m/s", steering_words(answer.drive.steering_rad)]
    return f"{', '.join(filter(None, words))}: {answer.reason}"
