"""The recorder's thread: keeps the last half minute, and writes files while there is something to record.

Nothing here is urgent and everything may fail. A file that the disk refuses is given up as it is; the messages that it
lacks are still in memory and go into the next one, which is tried every few seconds.
"""

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from wallride.runtime.control.own_laws.law_class import loaded_files
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording import channels
from wallride.runtime.recording.black_box import Memory
from wallride.runtime.recording.channels import RecordMessage
from wallride.runtime.recording.disk import Disk, explain
from wallride.runtime.recording.laws_fingerprint import laws_fingerprint
from wallride.runtime.recording.mcap_file import McapFile
from wallride.runtime.recording.recover import RecoveryError, file_state, recover
from wallride.runtime.recording.ring import FILE_SHARE, MB, Ring, entries
from wallride.runtime.settings.recording import RecordingSettings
from wallride.runtime.wire import topics

log = logging.getLogger("wallride.recording")

FLUSH_S = 0.4
"""Maximum age, besides one turn of the thread, of messages that are not on the disk."""
RETRY_S = 5.0
FILL_B = 256 << 10
"""Length at which remembered messages are written: half a minute of them at once would take as much memory again."""
HOLD_S = 0.5
"""A recording that begins this soon after the last one's end stays open for this time: starts and stops in quick turn
go into one file."""
HOUSEKEEPING_S = 5.0
TAIL_S = 5.0
"""Duration of a black box after its stop; another stop within it goes into the same file."""
MAX_TAIL_S = 30.0
MIN_MEMORY_S = 1.0
START_UP_S = 5.0
"""Time since the process began after which a recording begins without a scan; else it begins with the first scan."""


@dataclass(frozen=True, slots=True)
class FileMetadata:
    """Metadata of every file. began_s: when the process began, on the monotonic clock."""

    car: str
    version: str
    began_s: float
    wall_clock: WallClock


@dataclass(frozen=True, slots=True)
class WriterReport:
    """The writer's state; a new object replaces the old one, so that another thread may read it at any time.

    file: the one being written, "" without one. why: why it is (not) recorded. trouble: the disk's error.
    """

    file: str = ""
    why: str = "not started"
    trouble: str = ""
    written_bytes: int = 0
    black_box: str = ""


@dataclass(slots=True)
class _Box:
    """An open black box."""

    file: McapFile
    reason: str
    opened_s: float
    until_s: float


class RecordingWriter:
    """Takes messages, `turn` by turn.

    breathe: called between two pieces of work, so that the car's thread may run in between.
    """

    def __init__(
        self,
        settings: RecordingSettings,
        ring: Ring,
        disk: Disk,
        facts: FileMetadata,
        *,
        breathe: Callable[[], None],
    ) -> None:
        self.report = WriterReport()
        self.wished: bool | None = None  # a client's request; None is "by itself"
        self._settings = settings
        self._ring = ring
        self._disk = disk
        self._facts = facts
        self._breathe = breathe
        self._laws = laws_fingerprint(*loaded_files())  # now, while the files are those that were loaded
        self._memory = Memory(max(settings.black_box_s, MIN_MEMORY_S))
        self._run: McapFile | None = None
        self._is_held = False  # the open recording is not wanted any more
        self._hold_until_s = self._ended_s = -math.inf
        self._box: _Box | None = None
        self._trouble = ""
        self._now_s = 0.0
        self._stepped_ns = 0
        self._first_scan_ns = 0  # 0: none yet, or only long after the process began
        self._retry_s = 0.0
        self._flush_s = 0.0
        self._tidy_s = 0.0
        self._unwritten = 0  # number of the first message that no finished or flushed part of a recording holds
        self._goes_on = ""
        self._unfinished: list[Path] | None = None

    def turn(self, fresh: Iterable[RecordMessage], stops: list[str], active_s: float, now_s: float) -> None:
        """Take in the messages and stops since the last turn. active_s: when the car was last armed or moving."""
        self._now_s = now_s
        for message in fresh:
            self._take(message)
            self._breathe()
        for reason in stops:
            self._on_stop(reason)
        self._follow_wall_clock()
        wanted = self._wanted(active_s)
        self._begin_or_end(wanted=wanted)
        if now_s >= self._flush_s:
            self._flush_s = now_s + FLUSH_S
            self._flush()
        if now_s >= self._tidy_s:
            self._tidy_s = now_s + HOUSEKEEPING_S
            self._keep_house()
        self._tell(wanted=wanted)

    def close(self) -> None:
        """Finish open files, and write the messages that still waited for a first scan."""
        if self._run is None and self._wanted(-math.inf) and not self._has_begun():
            self._begin_run()
        self._end_run()
        self._end_box()
        self.report = WriterReport(why="the recorder has ended", trouble=self._trouble)

    def _take(self, message: RecordMessage) -> None:
        if message.topic == topics.SCAN and not self._first_scan_ns and not self._is_started_up():
            self._first_scan_ns = message.stamp_ns
        self._memory.add(message)
        for file in self._open_files():
            file.add(message)

    def _open_files(self) -> Iterable[McapFile]:
        if self._run is not None and not self._is_held:
            yield self._run
        if self._box is not None:
            yield self._box.file

    def _begin_or_end(self, *, wanted: bool) -> None:
        if self._run is None:
            if wanted and self._now_s >= self._retry_s and (self.wished or self._has_begun()):
                self._begin_run()
            elif not wanted and self._now_s >= self._retry_s:
                self._trouble = ""
                if not self._memory.holds(self._unwritten):
                    self._goes_on = ""
        elif not wanted:
            self._hold_or_end(self._run)
        elif self._is_held:
            self._is_held = False
            self._hold_until_s = self._now_s + HOLD_S
            self._fill(self._run, self._memory.after(self._unwritten))
        elif self._run.bytes_written > min(self._settings.file_mb, FILE_SHARE * self._settings.ring_mb) * MB:
            self._end_run()
            self._begin_run()
        if self._box is not None and self._now_s >= self._box.until_s:
            self._end_box()

    def _wanted(self, active_s: float) -> bool:
        active = self._now_s - active_s < self._settings.after_s
        if self.wished is False and self._settings.start == "armed" and not active:
            self.wished = None  # a request to stop one recording does not forbid the next drive's
        if self.wished is not None:
            return self.wished
        return self._settings.start == "always" or (self._settings.start == "armed" and active)

    def _hold_or_end(self, run: McapFile) -> None:
        if self._now_s >= self._hold_until_s:
            self._end_run()
            self._ended_s = self._now_s
        elif not self._is_held and self._try(run, run.flush):
            self._is_held = True
            self._unwritten = self._memory.next_number

    def _begin_run(self) -> None:
        file = self._open(None)
        if file is None:
            return
        goes_on = self._goes_on
        self._run, self._is_held = file, False
        self._hold_until_s = self._now_s + HOLD_S if self._now_s - self._ended_s < HOLD_S else -math.inf
        if self._fill(file, self._memory.since(self._unwritten if goes_on else 0)):
            self._trouble = ""
            log.info("recording %s", file.path.name)
        else:  # all its messages come again with the next attempt
            self._goes_on = goes_on
            self._disk.discard(file.path)

    def _on_stop(self, reason: str) -> None:
        now_s = self._now_s
        self._take(self._event("stop", reason))
        if self._settings.black_box_s <= 0:
            return
        if self._box is not None:
            self._box.until_s = min(now_s + TAIL_S, self._box.opened_s + MAX_TAIL_S)
            return
        self._begin_box(reason, now_s, now_s + TAIL_S)

    def _begin_box(self, reason: str, opened_s: float, until_s: float) -> None:
        file = self._open(reason)
        if file is None:
            return
        self._box = _Box(file, reason, opened_s, until_s)
        if self._fill(file, self._memory.since(0)):
            log.info("black box %s", file.path.name)
        elif not file.bytes_written:
            self._disk.discard(file.path)

    def _open(self, reason: str | None) -> McapFile | None:
        """Open a file; None when the disk has no room for it."""
        try:
            if not self._ring.make_room():
                self._on_trouble(f"less than {self._settings.keep_free_mb} MB of the disk are free")
                return None
            wall_clock = self._facts.wall_clock
            path = self._ring.next_path(wall_clock.unix_ns(self._now_s), reason)
            return McapFile(
                path, self._disk, self._metadata(reason), f"wallride {self._facts.version}",
                shift_ns=wall_clock.stepped_ns, begin_ns=self._first_scan_ns,
            )  # fmt: skip
        except OSError as error:
            self._on_trouble(explain(error))
            return None

    def _metadata(self, reason: str | None) -> Mapping[str, str]:
        return {
            "car": self._facts.car,
            "version": self._facts.version,
            "laws": self._laws,
            "kind": "recording" if reason is None else "black box",
            "reason": reason or "",
            "continues": self._goes_on if reason is None else "",
            "epoch_ns": str(self._facts.wall_clock.epoch_ns),
        }

    def _event(self, event: str, reason: str) -> RecordMessage:
        payload = channels.text(topics.encode({"stamp_s": self._now_s, "event": event, "reason": reason}))
        return RecordMessage(
            channels.EVENTS, channels.STRING, self._facts.wall_clock.started_unix_ns(self._now_s), payload
        )

    def _has_begun(self) -> bool:
        """Tell whether there is a first scan to begin with, or the wait for it is over."""
        return self._first_scan_ns > 0 or self._is_started_up()

    def _is_started_up(self) -> bool:
        """Tell whether the start-up is over, during which a recording waits for the first scan."""
        return self._now_s - self._facts.began_s > START_UP_S

    def _follow_wall_clock(self) -> None:
        """Record a step of the computer's clock in open files and continue in another file, with correct stamps."""
        stepped_ns = self._facts.wall_clock.stepped_ns
        if stepped_ns == self._stepped_ns:
            return
        step_s, self._stepped_ns = (stepped_ns - self._stepped_ns) / 1e9, stepped_ns
        self._take(self._event("clock", f"the computer's clock was set by {step_s:+.3f} s; stamps before it are off"))
        if self._run is not None:
            self._end_run()
            if not self._is_held:
                self._begin_run()

    def _fill(self, file: McapFile, remembered: Iterable[RecordMessage]) -> bool:
        """Write remembered messages into a file; False when the disk refused."""
        for message in remembered:
            file.add(message)
            if file.bytes_waiting > FILL_B and not self._try(file, file.write):
                return False
            self._breathe()
        return self._try(file, file.flush)

    def _flush(self) -> None:
        for file in list(self._open_files()):
            if self._try(file, file.flush) and file is self._run:
                self._unwritten = self._memory.next_number

    def _end_run(self) -> None:
        """End the recording; the next one goes on where it ended, as long as that is remembered."""
        if self._run is not None:
            file = self._run
            if self._try(file, file.close):
                if not self._is_held:
                    self._unwritten = self._memory.next_number
                log.info("recorded %s: %.1f MB", file.path.name, file.bytes_written / MB)
            self._run, self._goes_on = None, file.path.name

    def _end_box(self) -> None:
        if self._box is not None:
            self._try(self._box.file, self._box.file.close)
            self._box = None

    def _try(self, file: McapFile, act: Callable[[], None]) -> bool:
        """Perform an operation on a file; give it up when the disk refuses."""
        try:
            act()
        except OSError as error:
            self._give_up(file)
            self._on_trouble(f"{explain(error)} ({file.path.name} is cut short)")
            return False
        return True

    def _give_up(self, file: McapFile) -> None:
        if file is self._run:
            self._run, self._goes_on = None, file.path.name
        elif self._box is not None and file is self._box.file:
            self._box = None
        try:
            file.abandon()
        except OSError as error:
            log.debug("%s: %s", file.path, error)  # the error itself is reported already
        self._unfinished = None  # look for it again, when there is time

    def _on_trouble(self, words: str) -> None:
        if words != self._trouble:
            log.warning("not recording: %s; trying again every %.0f s", words, RETRY_S)
        self._trouble = words
        self._retry_s = self._now_s + RETRY_S

    def _keep_house(self) -> None:
        """Keep the ring within its limits, and finish the torn files of earlier runs."""
        try:
            self._look_after_open_files()
            if not self._ring.make_room() and self._run is not None:
                self._on_trouble(f"less than {self._settings.keep_free_mb} MB of the disk are free")
                self._end_run()
            if self._run is None and self._box is None:
                self._finish_one()
        except OSError as error:
            if explain(error) != self._trouble:
                log.warning("the recordings' folder: %s", explain(error))

    def _look_after_open_files(self) -> None:
        """Give up a file that another program deleted, moved or changed; what is remembered goes into a new one."""
        run, box = self._run, self._box
        for file in (run, box.file if box is not None else None):
            if file is None or file.is_there():
                continue
            log.warning(
                "%s was deleted, moved or changed by another program: another file begins with the last %.0f s",
                file.path, self._settings.black_box_s,
            )  # fmt: skip
            self._try(file, file.close)
            if file is run:
                self._run, self._goes_on = None, ""
            elif box is not None:
                self._box = None
                self._begin_box(box.reason, box.opened_s, box.until_s)

    def _finish_one(self) -> None:
        """Finish one torn file; one at a time, because the next turn should come soon."""
        if self._unfinished is None:
            present = [self._ring.folder / entry.name for entry in entries(self._ring.folder)]
            self._unfinished = [path for path in present if file_state(path) == "unfinished"]
        if not self._unfinished:
            return
        path = self._unfinished.pop()
        if path.stat().st_size == 0:
            self._disk.remove(path)
            return
        try:
            found = recover(path, self._breathe)
            log.info("finished %s: %d messages, %d bytes cut off", path.name, found.messages, found.cut_bytes)
        except RecoveryError as error:
            log.warning("%s", error)

    def _tell(self, *, wanted: bool) -> None:
        file = self._run
        if self.wished is not None:
            why = "asked for" if self.wished else "asked not to"
        elif self._settings.start == "armed":
            why = "armed" if wanted else "disarmed"
        else:
            why = self._settings.start
        self.report = WriterReport(
            file=file.path.name if file is not None else "",
            why=why,
            trouble=self._trouble,
            written_bytes=file.bytes_written if file is not None else 0,
            black_box=self._box.file.path.name if self._box is not None else "",
        )
