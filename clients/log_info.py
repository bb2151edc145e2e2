"""`wallride logs info`: content of a recording, also of one without its end."""

import json
import struct
from array import array
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from wallride.clients.connection import ConnectionProblemError
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.channels import EVENTS, text_of
from wallride.runtime.recording.mcap_file import METADATA
from wallride.runtime.recording.mcap_reading import Damage, FileFacts, LoggedRecord, McapReader
from wallride.runtime.recording.recover import is_whole
from wallride.runtime.recording.unpacking import UnpackingError

WEEK_NS = 7 * 24 * 3600 * NS


@dataclass(slots=True)
class Info:
    """Result of a pass over a file. times_ns: of each message, since 1970. events: time, kind, reason."""

    facts: dict[str, str] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    sizes_bytes: Counter[str] = field(default_factory=Counter)
    kinds: dict[str, str] = field(default_factory=dict)
    times_ns: "array[int]" = field(default_factory=lambda: array("Q"))
    events: list[tuple[int, str, str]] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)


def describe(path: Path, *, as_json: bool) -> str:
    """Return a file's content, as readable lines or as JSON; ConnectionProblemError for other files."""
    try:
        info = read(path)
        whole = is_whole(path)
    except OSError as error:
        raise ConnectionProblemError(f"{path}: cannot be read: {error.strerror or error}") from None
    if not info.counts:
        raise ConnectionProblemError(f"{path}: holds no message{f' ({info.damage[0].reason})' if info.damage else ''}")
    begins_ns, ends_ns = _span_ns(info.times_ns)
    info.events = [event for event in info.events if begins_ns <= event[0] <= ends_ns]
    fields = {
        "file": str(path),
        "size_bytes": path.stat().st_size,
        "whole": whole,
        "damaged_pieces": sum(not one.is_end for one in info.damage),
        **info.facts,
        "begins": datetime.fromtimestamp(begins_ns / NS, UTC).isoformat(timespec="milliseconds"),
        "seconds": round((ends_ns - begins_ns) / NS, 3),
        "messages": info.counts.total(),
        "topics": {topic: {"type": info.kinds[topic], "messages": count} for topic, count in info.counts.items()},
        "stops": _events(info, "stop", begins_ns),
        "clock_steps": _events(info, "clock", begins_ns),
    }
    if as_json:
        return json.dumps(fields, indent=2)
    return "\n".join(map(one_line, _lines(fields, info)))


def read(path: Path) -> Info:
    """Read all of a file that can be read."""
    info = Info()
    try:
        for found in McapReader(path):
            match found:
                case FileFacts(name, values) if name == METADATA:
                    info.facts = values
                case LoggedRecord():
                    info.kinds[found.topic] = found.schema or found.encoding
                    _count(info, found.topic, found.record)
                case Damage():
                    info.damage.append(found)
    except UnpackingError as error:
        raise ConnectionProblemError(f"{path}: {error}") from None
    return info


def _count(info: Info, topic: str, message: Any) -> None:  # noqa: ANN401 - mcap's
    info.counts[topic] += 1
    info.sizes_bytes[topic] += len(message.data)
    info.times_ns.append(message.log_time)
    if topic.strip("/") == EVENTS:
        with suppress(ValueError, KeyError, struct.error):
            event = json.loads(text_of(message.data))
            info.events.append((message.log_time, str(event["event"]), str(event["reason"])))


def _span_ns(times_ns: "array[int]") -> tuple[int, int]:
    """Return the first and last time; a damaged one lies years from the others, and a set clock begins a new file."""
    middle_ns = sorted(times_ns)[len(times_ns) // 2]
    credible = [time_ns for time_ns in times_ns if abs(time_ns - middle_ns) < WEEK_NS]
    return min(credible), max(credible)


def _events(info: Info, kind: str, begins_ns: int) -> list[dict[str, Any]]:
    return [
        {"at_s": round((at_ns - begins_ns) / NS, 3), "reason": reason}
        for at_ns, event, reason in info.events
        if event == kind
    ]


def _lines(fields: dict[str, Any], info: Info) -> Iterator[str]:
    yield f"{fields['file']}   {fields['size_bytes'] / 1e6:.1f} MB"
    if not fields["whole"]:
        yield f"without its end (wallride logs recover {fields['file']})"
    if fields["damaged_pieces"]:
        yield f"{fields['damaged_pieces']} damaged pieces are left out"
    if info.facts:
        what = f"{info.facts.get('kind', 'recording')} {info.facts.get('reason', '')}".strip()
        yield f"{what} of {info.facts.get('car', '?')}, wallride {info.facts.get('version', '?')}"
        if info.facts.get("continues"):
            yield f"goes on from {info.facts['continues']}"
    yield f"{fields['begins']}, {fields['seconds']:.1f} s, {fields['messages']} messages"
    seconds = fields["seconds"] or 1.0
    for topic, count in sorted(info.counts.items()):
        volume = info.sizes_bytes[topic] / seconds / 1000
        yield f"  {topic:<17} {info.kinds[topic]:<42} {count:7d}  {count / seconds:6.1f} Hz  {volume:7.1f} kB/s"
    for stop in fields["stops"]:
        yield f"  black box at {stop['at_s']:.1f} s: {stop['reason']}"
    for step in fields["clock_steps"]:
        yield f"  at {step['at_s']:.1f} s {step['reason']}"
