"""Data of a recorded run, as plain series on one clock; times are seconds since its decision log began."""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from wallride.runtime.arbitration.command import NO_WINNER
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording import decision_codec
from wallride.runtime.recording.channels import TAPE
from wallride.runtime.recording.decision_codec import TapeError
from wallride.runtime.recording.decision_log import ScanEvent
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import DriveLog, LoggedMessage, decode
from wallride.sim.replay.faults import RecordedFault, faults_in
from wallride.sim.replay.reenact import first_time_s
from wallride.sim.replay.settings_text import TunedSetting, settings_of, tuned_in
from wallride.sim.world.pose import Floats

SECONDS_OF_A_DAY = 86_400


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Values (n,) over times (n,)."""

    time_s: Floats
    value: Floats

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.time_s)


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPath:
    """Poses of the rear axle, all (n,), and the speed along the car. by: what tells the places. drifts: does it?"""

    time_s: Floats
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    speed_mps: Floats
    by: str = "odometry"
    drifts: bool = True


@dataclass(frozen=True, slots=True)
class MuxChange:
    """A change of the mux's decision. Speeds: requested by the driver (NaN without), after the caps, and as sent."""

    time_s: float
    winner: str
    driver: str
    reason: str
    measure: float
    asked_mps: float
    allowed_mps: float
    sent_mps: float
    delivered: bool


@dataclass(eq=False)
class RecordedRun:
    """All data of the page. statuses: (time, fields). duration_s: to the last message.

    zero_unix_s: when its decision log began, without one its first message's time, since 1970, 0 where it has no date.
    settings: at the beginning. tuned: changes of them, with their times. faults: what went wrong, with its time.
    """

    name: str
    car: str
    version: str
    began: str
    source: str
    settings: Settings
    notes: Sequence[str]
    scans: list[tuple[float, LoggedMessage]]
    error: Series
    path: DrivenPath
    wish: Series
    sent: Series
    steering: Series
    changes: list[MuxChange]
    statuses: Sequence[tuple[float, Mapping[str, Any]]] = ()
    duration_s: float = 0.0
    zero_unix_s: float = 0.0
    tuned: Sequence[tuple[float, TunedSetting]] = ()
    faults: Sequence[tuple[float, RecordedFault]] = ()

    @property
    def status(self) -> Mapping[str, Any]:
        """Return the newest status, empty if none was recorded."""
        return self.statuses[-1][1] if self.statuses else {}

    def scan_at(self, time_s: float) -> LoggedMessage | None:
        """Return the newest scan at a time, or the first one; None without any."""
        if not self.scans:
            return None
        times_s = [stamp_s for stamp_s, _ in self.scans]
        return self.scans[max(0, bisect_left(times_s, time_s + 1e-6) - 1)][1]


def run_of(log: DriveLog) -> RecordedRun:
    """Return the run recorded in a log. No code of the user runs: the answers of an own law are in the log."""
    zero_ns = _begins_ns(log) or min((message.stamp_ns for message in log.messages if message.stamp_ns > 0), default=0)
    if log.messages and log.messages[0].stamp_ns < SECONDS_OF_A_DAY * NS:  # foreign recordings have no date
        zero_ns = 0

    def seconds(time_ns: int) -> float:
        return (time_ns - zero_ns) / NS

    statuses = [(seconds(time_ns), fields) for time_ns, fields in log.json(topics.STATUS)]
    errors = [(seconds(message.stamp_ns), decode(message).data) for message in log.of(topics.DISTANCE_ERROR)]
    outputs = [(message.stamp_ns, decode(message).drive) for message in log.of(topics.OUTPUT)]
    wishes = [(message.stamp_ns, decode(message).drive) for message in _wishes(log)]
    status = statuses[-1][1] if statuses else {}
    return RecordedRun(
        name=log.name,
        car=str(log.fact("car") or status.get("car") or "car"),
        version=str(log.fact("version") or status.get("version") or ""),
        began=datetime.fromtimestamp(zero_ns / NS, UTC).strftime("%Y-%m-%d %H:%M:%S UTC") if zero_ns else "",
        source=log.fact("source"),
        settings=settings_of(log, laws=False),
        notes=log.notes,
        scans=[(seconds(message.stamp_ns), message) for message in log.of(topics.SCAN)],
        error=_series(errors),
        path=_path(log, zero_ns),
        wish=_series([(seconds(at_ns), drive.speed) for at_ns, drive in wishes]),
        sent=_series([(seconds(at_ns), drive.speed) for at_ns, drive in outputs]),
        steering=_series([(seconds(at_ns), drive.steering_angle) for at_ns, drive in outputs]),
        changes=_changes(log, zero_ns),
        statuses=statuses,
        zero_unix_s=zero_ns / NS,
        tuned=[(seconds(one.stamp_ns), one) for one in tuned_in(log)],
        faults=[(seconds(one.stamp_ns), one) for one in faults_in(log)],
        duration_s=max((seconds(message.stamp_ns) for message in log.messages), default=0.0),
    )


def _begins_ns(log: DriveLog) -> int:
    """Return when the decision log began, since 1970, from which `wallride replay` counts; 0 where there is none."""
    try:
        events = decision_codec.decode(log.of(TAPE)[0].payload)
    except (IndexError, TapeError):
        return 0
    stamps_ns = {message.sequence: message.stamp_ns for message in log.of(topics.SCAN)}
    scans = (event for event in events if isinstance(event, ScanEvent) and event.sequence in stamps_ns)
    if (scan := next(scans, None)) is None:
        return 0
    return stamps_ns[scan.sequence] + round((first_time_s(events) - scan.stamp_s) * NS)


def _wishes(log: DriveLog) -> list[LoggedMessage]:
    """Return the requests of the driving source: the operator's where there are any at that time, else navigation's."""
    both = [*log.of(topics.NAVIGATION), *log.of(topics.TELEOP)]
    return sorted(both, key=lambda message: message.stamp_ns)


def _path(log: DriveLog, zero_ns: int) -> DrivenPath:
    rows = []
    for message in log.of(topics.ODOM):
        said = decode(message)
        pose, turn = said.pose.pose, said.pose.pose.orientation
        yaw_rad = 2 * math.atan2(turn.z, turn.w)
        rows.append(
            ((message.stamp_ns - zero_ns) / NS, pose.position.x, pose.position.y, yaw_rad, said.twist.twist.linear.x)
        )
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return DrivenPath(*table.T)


def _changes(log: DriveLog, zero_ns: int) -> list[MuxChange]:
    """Return the decisions at which winner, driver, reason or delivery changed."""
    changes: list[MuxChange] = []
    mind: tuple[object, ...] = ()
    for time_ns, fields in log.json(topics.DECISION):
        now = tuple(fields.get(name) for name in ("winner", "driver", "reason", "delivered"))
        if now == mind:
            continue
        mind = now
        changes.append(
            MuxChange(
                time_s=(time_ns - zero_ns) / NS,
                winner=str(fields.get("winner") or NO_WINNER),
                driver=str(fields.get("driver") or ""),
                reason=str(fields.get("reason") or ""),
                measure=_number(fields.get("measure")),
                asked_mps=_number(fields.get("asked_mps")),
                allowed_mps=_number(fields.get("allowed_mps")),
                sent_mps=_number(fields.get("speed_mps")),
                delivered=bool(fields.get("delivered", True)),
            )
        )
    return changes


def _series(rows: Sequence[tuple[float, float]]) -> Series:
    table = np.array(rows, dtype=np.float64).reshape(-1, 2)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return Series(table[:, 0], table[:, 1])


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
