"""Association of motor commands with the scans that they answer, and their latency. Pure.

A command answers a scan when it is the first one after it whose servo position is another than before: the pictures
alternate so that the right steering always changes (`course`). Commands of the mux's own tick repeat the old position
and answer no scan.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from wallride.sim.bench.devices import MotorCommand
from wallride.sim.bench.rig import SentScan


@dataclass(slots=True)
class AnswerTimes:
    """latency_s: of every answered scan. any_s: until the first command of any kind. unanswered: scans without."""

    latency_s: list[float] = field(default_factory=list)
    any_s: list[float] = field(default_factory=list)
    unanswered: int = 0

    def figures_ms(self) -> dict[str, float]:
        """Return p50, p99, p99.9 and max in milliseconds, for both ways to count."""
        return {**percentiles_ms(self.latency_s), **{f"any_{k}": v for k, v in percentiles_ms(self.any_s).items()}}


def percentiles_ms(samples_s: Sequence[float]) -> dict[str, float]:
    """Return p50, p99, p99_9 and max in milliseconds; {} without samples."""
    if not samples_s:
        return {}
    milliseconds = np.array(samples_s) * 1000
    p50, p99, p99_9 = np.percentile(milliseconds, [50, 99, 99.9])
    return {"p50": float(p50), "p99": float(p99), "p99_9": float(p99_9), "max": float(milliseconds.max())}


def pair(sent: Sequence[SentScan], commands: Sequence[MotorCommand]) -> AnswerTimes:
    """Pair every scan with its answer, which must come before the next scan.

    A scan counts as written when the call returned; where the scheduler gave the core to the car within the call, and
    so it took longer than usual, as long after its beginning as usual.
    """
    answers = AnswerTimes()
    usual_s = median(scan.at_s - scan.begun_s for scan in sent) if sent else 0.0
    times_s = [command.at_s for command in commands]
    for i, scan in enumerate(sent):
        first = bisect_right(times_s, scan.begun_s)
        last = bisect_right(times_s, sent[i + 1].begun_s) if i + 1 < len(sent) else len(commands)
        if first == 0 or first == last:
            answers.unanswered += 1
            continue
        written_s = min(scan.at_s, scan.begun_s + usual_s)
        answers.any_s.append(times_s[first] - written_s)
        before = commands[first - 1].servo
        changed = next((c for c in commands[first:last] if c.servo != before), None)
        if changed is None:
            answers.unanswered += 1
        else:
            answers.latency_s.append(changed.at_s - written_s)
    return answers


@dataclass(slots=True)
class Onsets:
    """Reactions to boards that suddenly stand before the car.

    onsets: those that met a moving car which had answered the scan before: one that its computer held up answers that
    scan under the board. slipped: moving commands that were computed from a blocked scan. stops_s: from the first
    blocked scan to the first command that does not move.
    """

    onsets: int = 0
    slipped: int = 0
    stops_s: list[float] = field(default_factory=list)

    def figures(self) -> Mapping[str, float]:
        """Return the counts, and the times in milliseconds."""
        return {"onsets": self.onsets, "slipped": self.slipped, **percentiles_ms(self.stops_s)}


def onsets(sent: Sequence[SentScan], commands: Sequence[MotorCommand]) -> Onsets:
    """Count; a moving command under a board is a slip unless it only repeats the steering of an older scan."""
    found = Onsets()
    times_s = [command.at_s for command in commands]
    for i, scan in enumerate(sent):
        if not scan.blocked or i == 0 or sent[i - 1].blocked:
            continue
        free = next((later for later in sent[i:] if not later.blocked), None)
        first = bisect_right(times_s, scan.begun_s)
        last = bisect_right(times_s, free.begun_s) if free is not None else len(commands)
        answers = range(max(1, bisect_right(times_s, sent[i - 1].begun_s)), first)
        is_prompt = any(commands[k].servo != commands[k - 1].servo for k in answers)
        if not is_prompt or not commands[first - 1].moving:
            continue
        found.onsets += 1
        under = commands[first:last]
        stopped = next((k for k, command in enumerate(under) if not command.moving), len(under))
        if stopped < len(under):
            found.stops_s.append(under[stopped].at_s - scan.at_s)
        older_servo = commands[first - 1].servo
        late = [c for k, c in enumerate(under) if c.moving and (k > stopped or c.servo != older_servo)]
        found.slipped += len(late)
    return found
