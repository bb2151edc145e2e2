"""Repetition of wallride's own recording by the same code, compared decision by decision.

Inputs are taken from the decision log: scans, motor states, operators' commands, presence of the motor, and every
reading of the clock. The outputs of the laws, the mux and the limiter are computed anew. The recorded car does not
follow the replay: after a first difference the two remain decisions on the same input.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np
from pydantic import ValidationError

from wallride.drivers.api import Scan
from wallride.runtime.arbitration.command import Output, Source
from wallride.runtime.arbitration.queues import NEVER_S
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.own_laws.law_class import loaded_files
from wallride.runtime.line_files import read_course
from wallride.runtime.map_files import MapError
from wallride.runtime.recording.channels import TAPE
from wallride.runtime.recording.decision_codec import TapeError, decode
from wallride.runtime.recording.decision_log import (
    LAWS,
    DecisionEvent,
    Event,
    FollowerEvent,
    OwnPartsEvent,
    SafetyEvent,
    ScanEvent,
    SettingsEvent,
)
from wallride.runtime.recording.laws_fingerprint import laws_fingerprint
from wallride.runtime.settings.imports import import_named
from wallride.runtime.settings.tree import Settings
from wallride.runtime.telemetry.course_messages import written
from wallride.runtime.wire import topics
from wallride.sim.recordings import RecordingError
from wallride.sim.replay import difference
from wallride.sim.replay.difference import CLOSE, Difference
from wallride.sim.replay.drive_log import DriveLog, stamp_ns
from wallride.sim.replay.drive_log import decode as decode_message
from wallride.sim.replay.settings_text import known_part, settings_of, with_assignments
from wallride.sim.replay.stack import ReplayStack

SETTLES_S = 5.0
"""Time after a beginning in the middle without comparison: the state before it is not in the decision log."""
SCANS_KEPT = 8
FIRST_SHOWN = 20


@dataclass(slots=True)
class ReplayVerdict:
    """Result of a replay. differing: number of different decisions; differences: the first of them.

    exact: whether values had to agree but for rounding. notes: sentences about data missing in the decision log.
    changed: sentence about laws, map or line other than the recorded ones; "" if they are the same.
    """

    decisions: int = 0
    answers: int = 0
    differing: int = 0
    scans: int = 0
    duration_s: float = 0.0
    exact: bool = True
    differences: list[Difference] = field(default_factory=list)
    largest_mps: float = 0.0
    notes: list[str] = field(default_factory=list)
    changed: str = ""

    @property
    def first(self) -> Difference | None:
        """Return the first difference, None when all is the same."""
        return self.differences[0] if self.differences else None


def events_of(log: DriveLog) -> list[Event]:
    """Return the decision log of a recording in order; RecordingError when it has none that can be read."""
    events: list[Event] = []
    unreadable = 0
    reason = ""
    for message in log.of(TAPE):
        try:
            events += decode(message.payload)
        except TapeError as error:
            unreadable, reason = unreadable + 1, str(error)
    if unreadable and not events:
        raise RecordingError(f"{log.name}: {reason}.")
    if not events:
        raise RecordingError(
            f"{log.name} has no decision log (topic {TAPE}), only what was shown:"
            f" it can be published and reported, not replayed. {' '.join(log.notes)}".rstrip()
        )
    if unreadable:
        log.notes.append(f"{unreadable} pieces of the decision log cannot be read ({reason}).")
    return sorted(events, key=lambda event: event.number)


def reenact(log: DriveLog, assignments: Sequence[str] = ()) -> ReplayVerdict:
    """Repeat the decisions of a recording, with other settings where they are assigned.

    SettingsError when an assignment is unusable, RecordingError when it holds no decisions.
    """
    events = events_of(log)
    return _Reenactment(log, events, assignments).run()


class _Script:
    """Clock readings during one event; further readings repeat the last one."""

    def __init__(self) -> None:
        self._answers: deque[float] = deque()
        self.now_s = 0.0

    def begin(self, times_s: Sequence[float]) -> None:
        self._answers = deque(times_s)
        if times_s:
            self.now_s = times_s[0]

    def __call__(self) -> float:
        if self._answers:
            self.now_s = self._answers.popleft()
        return self.now_s


class _Reenactment:
    def __init__(self, log: DriveLog, events: Sequence[Event], assignments: Sequence[str]) -> None:
        self._log = log
        self._events = events
        self._assignments = assignments
        self._ranges = _Ranges(log)
        self._clock = _Script()
        self._zero_s = first_time_s(events)
        self._verdict = ReplayVerdict(notes=[*log.notes])
        first = next((event.settings for event in events if isinstance(event, SettingsEvent)), None)
        if first is None and not log.settings_text:
            self._verdict.notes.append("its settings were not recorded: the defaults are taken.")
        settings = self._settings(first) if first is not None else settings_of(log, assignments)
        self._verdict.changed = changed_laws(log)  # by now the user's own laws are loaded
        self._stage = ReplayStack(settings, self._zero_s, self._clock, self._course(settings))
        self._scans: dict[int, Scan] = {}
        self._latest = -1
        self._adopts = True
        self._settled_s = self._zero_s

    def _course(self, settings: Settings) -> RaceCourse | None:
        """Return the course, where a follower of this drive needs it; the verdict says where it is another, or none."""
        drives = any(isinstance(one, SettingsEvent) and _method(one.settings) == "line" for one in self._events)
        if not drives and settings.wall_follow.method != "line":
            return None
        verdict = self._verdict
        try:
            course = read_course(settings.map, settings.car)
        except MapError as error:
            verdict.changed = verdict.changed or f"it drove a race line, whose map cannot be read: {error}"
            return None
        if not any(name.startswith("map.") for name in self._assignments):
            verdict.changed = verdict.changed or changed_course(self._log, course)
        return course

    def run(self) -> ReplayVerdict:
        expected = 0
        for event in self._events:
            if event.number > expected:
                self._gap(event.number - expected)
            expected = event.number + 1
            self._play(event)
        verdict = self._verdict
        verdict.duration_s = self._clock.now_s - self._zero_s
        if self._ranges.missing:
            verdict.notes.append(
                f"{self._ranges.missing} scans that the laws saw are not in the recording: they could not be replayed."
            )
        return verdict

    def _play(self, event: Event) -> None:
        match event:
            case ScanEvent():
                self._deliver(event)
            case SafetyEvent():
                if (scan := self._scans.get(event.sequence)) is not None:
                    self._clock.begin(event.times_s)
                    self._stage.look(scan, event.motor)
            case FollowerEvent():
                if (scan := self._scans.get(event.sequence)) is not None:
                    self._clock.begin(event.times_s)
                    self._compare_guidance(event, self._stage.follow(scan, event.motor))
            case DecisionEvent():
                self._step(event)
            case OwnPartsEvent():
                self._stage.laws.remember_own_parts(event.parts)
            case SettingsEvent():
                self._stage.apply(self._settings(event.settings))

    def _deliver(self, event: ScanEvent) -> None:
        ranges_m = self._ranges.of(event.sequence, event.beams)
        if ranges_m is None:
            return
        self._verdict.scans += 1
        self._latest = event.sequence
        self._scans[event.sequence] = event.scan(ranges_m)
        if len(self._scans) > SCANS_KEPT:
            del self._scans[next(iter(self._scans))]

    def _step(self, event: DecisionEvent) -> None:
        """Decide under the recorded commands of other sources; they are input, whatever their expiry was."""
        stage = self._stage
        for source in Source:
            if source in LAWS:
                continue
            if source not in event.live:
                stage.queue.withdraw(source)
            elif (word := event.words.get(source)) is not None:
                stage.queue.put(word, expires_at_s=NEVER_S)
        # A measured decision has read the clock before it.
        own = event.times_s.index(event.output.stamp_s) if event.output.stamp_s in event.times_s else 0
        self._clock.begin(event.times_s[own:])
        output = stage.step(delivered=event.output.delivered, braked=event.output.braked)
        if self._adopts:  # the previous drive is not in the decision log, and the limiter continues from it
            self._adopts = False
            stage.adopt(event.output.drive)
            if not event.output.delivered:
                stage.limiter.standstill()
            elif event.output.braked:
                stage.limiter.braked()
            return
        self._compare_output(event, output)

    def _compare_output(self, event: DecisionEvent, output: Output) -> None:
        verdict = self._verdict
        verdict.decisions += 1
        if event.output.stamp_s < self._settled_s:
            return
        found = list(difference.outputs(event.output, output, self._allowed))
        if found:
            verdict.differing += 1
            gap_mps = abs(event.output.decision.speed_mps - output.decision.speed_mps)
            verdict.largest_mps = max(verdict.largest_mps, gap_mps)
        self._note(event.output.stamp_s, found)

    def _compare_guidance(self, event: FollowerEvent, guidance: Guidance) -> None:
        self._verdict.answers += 1
        scan = self._scans[event.sequence]
        if scan.received_s >= self._settled_s:
            self._note(scan.received_s, list(difference.guidances(event.guidance, guidance, self._allowed)))

    def _note(self, time_s: float, found: Sequence[tuple[str, object, object]]) -> None:
        room = FIRST_SHOWN - len(self._verdict.differences)
        for what, recorded, replayed in found[: max(0, room)]:
            difference_ = Difference(time_s - self._zero_s, self._latest, what, recorded, replayed)
            self._verdict.differences.append(difference_)

    @property
    def _allowed(self) -> float:
        return 0.0 if self._verdict.exact else CLOSE

    def _gap(self, missing: int) -> None:
        self._verdict.exact = False
        if self._latest < 0:
            self._verdict.notes.append(
                "the recording begins while the car was running: what the laws had learnt before is unknown, so the"
                f" first {SETTLES_S:g} s are not compared, and values may differ by {CLOSE:g}."
            )
            self._settled_s = self._zero_s + SETTLES_S
        else:
            self._verdict.notes.append(f"{missing} events are missing after scan {self._latest}.")
            self._settled_s = self._clock.now_s + SETTLES_S
        self._adopts = True

    def _settings(self, tree: Any) -> Settings:  # noqa: ANN401 - plain values as recorded
        if missing := import_named(tree, laws=True, drivers=False):
            raise RecordingError(f"its own law cannot be used: {missing[0]['msg']}")
        tree = known_part(tree, self._verdict.notes)
        try:
            settings = Settings.model_validate(tree)
        except ValidationError as error:
            raise RecordingError(
                f"its settings are those of another version ({error.error_count()} do not fit):"
                " replay it with the version that recorded it."
            ) from None
        return with_assignments(settings, self._assignments)


def _method(tree: Any) -> object:  # noqa: ANN401 - plain values as recorded
    """Return the follower that recorded settings name."""
    return tree.get("wall_follow", {}).get("method") if isinstance(tree, dict) else None


class _Ranges:
    """Recorded scans by their numbers, decoded on demand. missing: number of requested scans that are not recorded."""

    def __init__(self, log: DriveLog) -> None:
        scans = list(log.of(topics.SCAN))
        self._messages = {message.sequence: message for message in scans}
        if len(self._messages) == 1 < len(scans):
            raise RecordingError(
                "its scans have lost their numbers, as in a copy that another program converted: take the original"
            )
        self.missing = 0

    def of(self, sequence: int, beams: int) -> "np.ndarray[Any, np.dtype[np.float32]] | None":
        message = self._messages.get(sequence)
        if message is None:
            self.missing += 1
            return None
        ranges_m = np.array(decode_message(message).ranges, np.float32)
        if ranges_m.size != beams:
            self.missing += 1
            return None
        ranges_m.setflags(write=False)
        return ranges_m


def changed_laws(log: DriveLog) -> str:
    """Return a sentence if the recorded laws differ, or may differ, from those that replay; "" for the same."""
    recorded, ours = log.fact("version"), version("wallride")
    laws = log.fact("laws")
    present = laws_fingerprint(*loaded_files())
    if laws == present:
        return ""
    if not laws:
        by = f"wallride {recorded}, which did" if recorded else "a wallride that did"
        return f"the laws may have changed since: it was recorded by {by} not name its laws"
    return f"the laws have changed since: recorded with {recorded} (laws {laws}), this is {ours} (laws {present})"


def changed_course(log: DriveLog, course: RaceCourse | None) -> str:
    """Return a sentence if map or line are not those that were recorded; "" for the same, and without a record."""
    for topic in topics.LASTING:
        for message in log.of(topic)[:1]:
            present = written(course, stamp_ns(decode_message(message))) if course is not None else {}
            if present.get(topic) != message.payload:
                return f"the {topic} that it drove by is not there, or has changed since"
    return ""


def first_time_s(events: Sequence[Event]) -> float:
    """Return when the decision log began, on the car's clock; 0 for an empty one."""
    return next(_times(events), 0.0)


def duration_s(events: Sequence[Event]) -> float:
    """Return the time from the first to the last decision or scan of a decision log; 0 for an empty one."""
    times_s = list(_times(events))
    return max(times_s) - times_s[0] if times_s else 0.0


def _times(events: Sequence[Event]) -> Iterator[float]:
    for event in events:
        if isinstance(event, DecisionEvent):
            yield event.output.stamp_s
        elif isinstance(event, ScanEvent):
            yield event.received_s
