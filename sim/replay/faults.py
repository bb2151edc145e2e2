"""What went wrong in a recorded drive: warnings of its log, devices that its statuses miss, commands without effect."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from wallride.drivers.api import NOT_OPENED, LinkState
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.channels import LOG
from wallride.runtime.wire import topics
from wallride.sim.figures.summary import count_words, device_counts
from wallride.sim.replay.drive_log import DriveLog

SERIOUS = frozenset({"WARNING", "ERROR", "CRITICAL"})
SAME_NS = 3 * NS // 2
"""Time within which the same words are told once: a status repeats what the log said up to a period before."""
UNHEARD = "the motor takes no commands"


@dataclass(frozen=True, slots=True)
class RecordedFault:
    """One thing that went wrong. stamp_ns: since 1970. lasted_s: NaN for a moment, and where nothing tells its end."""

    stamp_ns: int
    words: str
    lasted_s: float = math.nan


def faults_in(log: DriveLog) -> list[RecordedFault]:
    """Return what went wrong, in order; the same words within 1.5 s once."""
    found = sorted([*_logged(log), *_missing(log), *_counted(log), *_unheard(log)], key=lambda fault: fault.stamp_ns)
    kept: list[RecordedFault] = []
    last_ns: dict[str, int] = {}
    for fault in found:
        if fault.stamp_ns - last_ns.get(fault.words, fault.stamp_ns - 2 * SAME_NS) > SAME_NS:
            kept.append(fault)
        last_ns[fault.words] = fault.stamp_ns
    return kept


def _logged(log: DriveLog) -> Iterator[RecordedFault]:
    for stamp_ns, fields in log.json(LOG):
        if fields.get("level") in SERIOUS:
            yield RecordedFault(stamp_ns, str(fields.get("message")))


def _missing(log: DriveLog) -> Iterator[RecordedFault]:
    """Yield what the statuses tell: a black box may begin after the log line that said it."""
    last: dict[str, str] = {}
    for stamp_ns, fields in log.json(topics.STATUS):
        told: dict[str, str] = {}
        for device in ("lidar", "motor"):
            health = fields.get(device) or {}
            link, words = health.get("link"), health.get("message")
            if link in {LinkState.ABSENT, LinkState.FAULTY} and words != NOT_OPENED:
                told[device] = f"{device} {link}: {words}"
        if fields.get("fault"):
            told["fault"] = f"motor fault: {fields['fault']}"
        for subject, words in told.items():
            if words != last.get(subject):
                yield RecordedFault(stamp_ns, words)
        last = told


def _counted(log: DriveLog) -> Iterator[RecordedFault]:
    """Yield what the devices counted, as the statuses tell: each run of one kind within 1.5 s as one fault."""
    runs: dict[str, tuple[int, int, int]] = {}  # by kind: begin, newest, how often
    before: dict[str, int] = {}
    for stamp_ns, fields in log.json(topics.STATUS):
        for kind, count in device_counts(fields).items():
            if (more := count - before.get(kind, 0)) <= 0:
                continue
            began_ns, last_ns, some = runs.get(kind, (stamp_ns, stamp_ns, 0))
            if stamp_ns - last_ns > SAME_NS:
                yield _run_of(kind, began_ns, last_ns, some)
                began_ns, some = stamp_ns, 0
            runs[kind] = began_ns, stamp_ns, some + more
            before[kind] = count
    for kind, (began_ns, last_ns, some) in runs.items():
        yield _run_of(kind, began_ns, last_ns, some)


def _run_of(kind: str, began_ns: int, last_ns: int, count: int) -> RecordedFault:
    lasted_s = (last_ns - began_ns) / NS if last_ns > began_ns else math.nan
    return RecordedFault(began_ns, count_words(kind, count), lasted_s)


def _unheard(log: DriveLog) -> Iterator[RecordedFault]:
    """Yield each span in which the motor got no command, once it had got one."""
    began_ns, last_ns, heard = 0, 0, False
    for stamp_ns, fields in log.json(topics.DECISION):
        delivered = bool(fields.get("delivered", True))
        if began_ns and delivered:
            yield RecordedFault(began_ns, UNHEARD, (stamp_ns - began_ns) / NS)
            began_ns = 0
        elif heard and not delivered and not began_ns:
            began_ns = stamp_ns
        heard, last_ns = heard or delivered, stamp_ns
    if began_ns:
        yield RecordedFault(began_ns, UNHEARD, (last_ns - began_ns) / NS)
