"""Codec between the decision log and messages: JSON, with "nan", "inf" and "-inf" for numbers that JSON lacks."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from wallride.drivers.api import Correction, Drive, MotorState, Scan
from wallride.runtime.arbitration.command import Decision, DriveCommand, Output, QueueEntry, Source, SpeedLimit, Verdict
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.recording.decision_log import (
    DecisionEvent,
    Entry,
    Event,
    FollowerEvent,
    Heard,
    OlderEvent,
    OwnPartsEvent,
    SafetyEvent,
    ScanEvent,
    SettingsEvent,
)
from wallride.runtime.recording.own_parts_memory import known_parts
from wallride.runtime.settings.tree import Settings

FORMAT = 1


class TapeError(Exception):
    """A message that is not a piece of the decision log; the text gives the reason."""


def encode(entries: Sequence[Entry]) -> bytes:
    """Return one message, which can be read without any other."""
    batch = _Batch()
    events = [[number, kind, *_ENCODERS[kind](batch, *parts)] for number, kind, parts in entries]
    message = {"tape": FORMAT, "columns": _COLUMN_NAMES, "motors": batch.motors, "events": events}
    return json.dumps(message, separators=(",", ":"), default=_number).encode()


def decode(payload: bytes) -> list[Event]:
    """Return the events of one message; TapeError when it is none, or of another format."""
    try:
        message = json.loads(payload)
        if message["tape"] != FORMAT:
            raise TapeError(
                f"decision log of format {message['tape']} is not {FORMAT}: replay it with the version that recorded it"
            )
        return list(_events(message))
    except (ValueError, TypeError, KeyError, IndexError) as error:
        raise TapeError(f"not a piece of a decision log: {type(error).__name__} {error}") from None


@dataclass(slots=True)
class _Batch:
    """Shared state of one message: motor states by reference, and the entries that are written already."""

    motors: list[list[Any]] = field(default_factory=list)
    known_motors: dict[int, int] = field(default_factory=dict)
    words: dict[Source, QueueEntry] = field(default_factory=dict)

    def motor(self, state: MotorState | None) -> int | None:
        """Return the index of a motor state in the message."""
        if state is None:
            return None
        place = self.known_motors.get(id(state))  # it lives as long as the entries that hold it
        if place is None:
            place = self.known_motors[id(state)] = len(self.motors)
            self.motors.append(_row(MotorState, state))
        return place


_ROWS: tuple[type[Any], ...] = (MotorState, Drive, Verdict, Decision, Guidance)
_NOT_KEPT = frozenset({"promise"})
"""A replayed law makes its promise anew."""
_COLUMNS = {kind: tuple(column.name for column in fields(kind) if column.name not in _NOT_KEPT) for kind in _ROWS}
_FLOATS = {kind: frozenset(column.name for column in fields(kind) if column.type is float) for kind in _ROWS}
_COLUMN_NAMES = {kind.__name__: columns for kind, columns in _COLUMNS.items()}


def _row(kind: type[Any], value: object) -> list[Any]:
    return [_plain(getattr(value, name)) for name in _COLUMNS[kind]]


def _plain(value: Any) -> Any:  # noqa: ANN401 - whatever a field holds
    if isinstance(value, float):
        return value if math.isfinite(value) else str(float(value))
    return _row(Drive, value) if isinstance(value, Drive) else value


def _number(value: Any) -> Any:  # noqa: ANN401 - numpy's scalars
    return _plain(value.item())


def _times(times_s: Sequence[float]) -> list[Any]:
    return [_plain(time_s) for time_s in times_s]


def _encode_scan(_: _Batch, scan: Scan) -> list[Any]:
    numbers = (
        scan.stamp_s,
        scan.received_s,
        scan.angle_min_rad,
        scan.angle_step_rad,
        scan.range_min_m,
        scan.range_max_m,
    )
    row = [scan.sequence, *map(_plain, numbers), scan.ranges_m.shape[0], _plain(scan.ray_s)]
    done = scan.correction
    return row if done is None else [*row, *map(_plain, (done.x_mps, done.y_mps, done.yaw_rate_radps, done.ray_s))]


def _encode_look(batch: _Batch, scan: Scan, motor: MotorState | None, times_s: Sequence[float]) -> list[Any]:
    return [scan.sequence, batch.motor(motor), _times(times_s)]


def _encode_follow(
    batch: _Batch, scan: Scan, motor: MotorState | None, times_s: Sequence[float], guidance: Guidance
) -> list[Any]:
    return [scan.sequence, batch.motor(motor), _times(times_s), _row(Guidance, guidance)]


def _encode_step(batch: _Batch, times_s: Sequence[float], elapsed_s: float, live: Heard, output: Output) -> list[Any]:
    words = {}
    for word in live:
        if not isinstance(word, Source) and batch.words.get(word.source) is not word:
            batch.words[word.source] = word
            words[word.source] = _word(word)
    sources = [word if isinstance(word, Source) else word.source for word in live]
    return [
        _times(times_s), _plain(elapsed_s), sources, words, _plain(output.stamp_s),
        _row(Drive, output.drive), _row(Decision, output.decision), output.delivered, output.braked,
    ]  # fmt: skip


def _encode_settings(_: _Batch, settings: Settings) -> list[Any]:
    return [settings.model_dump(mode="json")]


def _encode_parts(_: _Batch, parts: KnownParts | None) -> list[Any]:
    return [asdict(parts) if parts is not None else None]


_ENCODERS: Mapping[str, Any] = {
    "scan": _encode_scan,
    "look": _encode_look,
    "follow": _encode_follow,
    "step": _encode_step,
    "settings": _encode_settings,
    "parts": _encode_parts,
}


def _word(word: QueueEntry) -> list[Any]:
    if isinstance(word, DriveCommand):
        return ["drive", word.source, _row(Drive, word.drive), _plain(word.scan_stamp_s), word.reason]
    verdict = word.assessment if isinstance(word.assessment, Verdict) else word.assessment.ask(0.0, 0.0)
    return ["cap", word.source, _row(Verdict, verdict), _plain(word.scan_stamp_s)]


def _events(message: Mapping[str, Any]) -> Iterator[Event]:
    columns = {kind: tuple(message["columns"][kind.__name__]) for kind in _ROWS}
    read = _RowReader(columns)
    motors = [read.row(MotorState, row) for row in message["motors"]]
    for number, kind, *parts in message["events"]:
        match kind:
            case "scan":
                sequence, stamp_s, received_s, first_rad, step_rad, least_m, most_m, beams, *rest = parts
                yield ScanEvent(
                    number, sequence, float(stamp_s), float(received_s), float(first_rad), float(step_rad),
                    float(least_m), float(most_m), beams, float(rest[0]) if rest else 0.0,
                    Correction(*map(float, rest[1:])) if rest[1:] else None,
                )  # fmt: skip
            case "look":
                sequence, motor, times_s = parts
                yield SafetyEvent(number, sequence, _state(motors, motor), read.times(times_s))
            case "follow":
                sequence, motor, times_s, row = parts
                guidance = read.row(Guidance, row)
                yield FollowerEvent(number, sequence, _state(motors, motor), read.times(times_s), guidance)
            case "say" | "silence":
                yield OlderEvent(number)
            case "step":
                yield read.step(number, parts)
            case "settings":
                yield SettingsEvent(number, parts[0])
            case "parts":
                yield OwnPartsEvent(number, known_parts(parts[0]) if parts[0] is not None else None)
            case _:
                raise ValueError(f"an event of a kind that this version does not know: {kind}")


def _state(motors: Sequence[MotorState], place: int | None) -> MotorState | None:
    return motors[place] if place is not None else None


@dataclass(frozen=True, slots=True)
class _RowReader:
    """Reads rows by the names of their columns, which the message contains."""

    columns: Mapping[type[Any], tuple[str, ...]]

    def row(self, kind: type[Any], row: Sequence[Any]) -> Any:  # noqa: ANN401 - an object of the kind
        values = dict(zip(self.columns[kind], row, strict=True))
        for name in _FLOATS[kind] & values.keys():
            values[name] = float(values[name])
        if "drive" in values and values["drive"] is not None:
            values["drive"] = self.row(Drive, values["drive"])
        if kind in {Decision, Verdict} and "steering_rad" in values:
            values["steering_rad"] = _maybe(values["steering_rad"])
        if kind is Decision:
            for name in ("driver", "winner"):
                values[name] = Source(values[name]) if values[name] is not None else None
        return kind(**values)

    def word(self, parts: Sequence[Any]) -> QueueEntry:
        form, source, row, stamp_s, *rest = parts
        if form == "drive":
            return DriveCommand(Source(source), self.row(Drive, row), _maybe(stamp_s), rest[0])
        return SpeedLimit(Source(source), self.row(Verdict, row), _maybe(stamp_s))

    def step(self, number: int, parts: Sequence[Any]) -> DecisionEvent:
        times_s, elapsed_s, live, words, stamp_s, drive, decision, *took = parts
        output = Output(float(stamp_s), self.row(Drive, drive), self.row(Decision, decision), *took)
        said = {Source(source): self.word(word) for source, word in words.items()}
        return DecisionEvent(number, self.times(times_s), float(elapsed_s), tuple(map(Source, live)), said, output)

    def times(self, times_s: Sequence[Any]) -> tuple[float, ...]:
        return tuple(map(float, times_s))


def _maybe(number: Any) -> float | None:  # noqa: ANN401 - a number, its text, or nothing
    return float(number) if number is not None else None
