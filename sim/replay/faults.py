"""What went wrong in a recorded drive: warnings of its log, devices that its statuses miss, commands without effect."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from wallride.drivers.api import NOT_OPENED, LinkState
from wallride.runtime.recording.channels import LOG
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import NS, DriveLog

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
    found = sorted([*_logged(log), *_missing(log), *_unheard(log)], key=lambda fault: fault.stamp_ns)
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
