"""The recorder's interface to the car: takes messages without waiting, and has a thread of its own write them.

Between the car's loop and the thread are two bounded queues; messages beyond the bound are dropped, counted and
reported. The thread works in short stretches and sleeps between them, because while it computes the loop cannot:
Python's lock is released when the thread sleeps, not when the loop wakes.
"""

import contextlib
import itertools
import json
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from wallride.drivers.api import Clock
from wallride.runtime.host.scheduling import ask_for_precedence
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording import channels
from wallride.runtime.recording.channels import RecordMessage
from wallride.runtime.recording.decision_log import MAX_EVENTS, DecisionLog
from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.ring import MB, Ring
from wallride.runtime.recording.transcriber import Transcriber
from wallride.runtime.recording.writer import FileMetadata, RecordingWriter
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.settings.recording import RecordingSettings, car_folder
from wallride.runtime.wire import topics

log = logging.getLogger("wallride.recording")

PERIOD_S = 0.1
"""Period of the thread: just after a command to the motor, when the loop has least to do."""
SILENT_PERIOD_S = 0.25
"""Period of the thread when there are no commands."""
WORK_S = 0.0003
REST_S = 0.0005
"""Duration of a stretch of work, and of the pause after it in which the thread releases Python's lock."""
MAX_WAITING_BYTES = 8_000_000
"""Maximum size of the waiting messages: about twenty seconds of everything."""
MAX_LINES = 1000
SILENT_DISK_S = 1.0
LOST_LATELY_S = 10.0
ARMED_S = 1.0
EARLY_SHARE = 0.2
PERIODS_S: Mapping[str, float] = MappingProxyType(
    {name: topic.recorded_s for name, topic in topics.TELEMETRY.items() if topic.recorded_s is not None}
)
"""Recording periods of telemetry's topics; motor states and decisions are all in the decision log, and every scan is
recorded."""


class Recorder:
    """A telemetry sink, and owner of the decision log, which runs from the beginning. The rest waits for `start`.

    folder: destination of the recordings. is_enabled: whether it records anything at all.
    """

    def __init__(
        self,
        settings: RecordingSettings,
        *,
        car: str,
        version: str,
        wall_clock: WallClock,
        clock: Clock,
        disk: Disk | None = None,
    ) -> None:
        self.folder = car_folder(settings, car)
        self.decision_log = DecisionLog(clock, MAX_EVENTS if settings.enabled else 0)
        self.is_enabled = settings.enabled
        self._settings = settings
        self._clock = clock
        self._disk = disk or Disk()
        self._waiting: deque[RecordMessage] = deque()
        self._lines: deque[tuple[float, logging.LogRecord]] = deque(maxlen=MAX_LINES)
        self._put_bytes = 0  # only the loop adds to this one, only the thread to the next: no lock is needed
        self._taken_bytes = 0
        self._next_s: dict[str, float] = {}
        self._lost = 0
        self._lost_at_s = float("-inf")
        self._busy_since_s: float | None = None
        self._failure, self._failures = "", 0
        self._listens = False
        self._wake = threading.Event()
        self._wake_s = 0.0
        self._ending = False
        self._pace = _Pace()
        ring = Ring(self.folder, settings, self._disk, _boot_id())
        self._unix_ns = wall_clock.started_unix_ns
        self._writer = RecordingWriter(
            settings, ring, self._disk, FileMetadata(car, version, clock(), wall_clock), breathe=self._pace
        )
        self._transcriber = Transcriber(wall_clock, clock())
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._handler = _Lines(self._lines, clock)

    def claim(self, topic: str, at_s: float, *, urgent: bool = False) -> bool:
        """Tell whether the next message of a topic would be recorded; scans are recorded from the decision log."""
        period_s = PERIODS_S.get(topic)
        if period_s is None or not self._listens:
            return False
        due_s = self._next_s.get(topic, -math.inf)
        if not urgent and at_s < due_s - EARLY_SHARE * period_s:
            return False
        self._next_s[topic] = (due_s if due_s > at_s - period_s else at_s) + period_s
        return True

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:
        """Take a message of telemetry."""
        if topic == topics.OUTPUT and (now_s := self._clock()) >= self._wake_s:
            self._wake_s = now_s + PERIOD_S
            self._wake.set()
        if schema not in _CDR_TYPES:
            schema, payload = channels.STRING, channels.text(payload)
        self._put(RecordMessage(topic, schema, self._unix_ns(stamp_s), payload, lasting=topic in topics.LASTING))

    def tap(self, device: str) -> Callable[[str, bytes, float], None] | None:
        """Return the function that takes the bytes of a device's link; None when they are not recorded.

        Its arguments: "in" or "out", bytes, time.
        """
        if not (self._settings.raw and self.is_enabled):
            return None

        def take(way: str, chunk: bytes, stamp_s: float) -> None:
            topic = f"{channels.RAW}/{device}/{way}"
            self._put(RecordMessage(topic, channels.BYTES, self._unix_ns(stamp_s), channels.octets(chunk)))

        return take

    def request(self, *, on: bool | None) -> None:
        """Begin a recording or end it, whatever the car does; None leaves it to `recording.start` again."""
        self._writer.wished = on
        self._wake.set()

    def listen(self) -> None:
        """Take telemetry from here on."""
        self._listens = self.is_enabled

    def start(self) -> None:
        """Take telemetry and log lines from here on, and have them written by the thread."""
        self.listen()
        if self.is_enabled:
            logging.getLogger().addHandler(self._handler)
            self._wake.set()
            self._thread.start()

    def close(self, timeout_s: float = 1.0) -> None:
        """Finish open files. A disk that does not answer in time is abandoned, and its file stays unfinished."""
        self._listens = False
        logging.getLogger().removeHandler(self._handler)
        self._ending = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def status(self) -> Mapping[str, Any]:
        """Return the recorder's state, as plain values and as text."""
        report = self._writer.report
        return {
            "on": bool(report.file),
            "file": report.file,
            "why": report.why,
            "requested": self._writer.wished,
            "words": self._words(),
            "written_mb": round(report.written_bytes / MB, 3),
            "lost": self._lost,
            "black_box": report.black_box,
        }

    @property
    def is_armed(self) -> bool:
        """Whether the car was armed or moving a moment ago."""
        return self._clock() - self._transcriber.active_s < ARMED_S

    @property
    def processor_s(self) -> float:
        """Return the processor time that the thread has used; 0 before it started and after its end."""
        if self._thread.ident is None or not self._thread.is_alive():
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(self._thread.ident))

    def turn(self) -> None:
        """Write the waiting messages; the thread does this ten times a second."""
        now_s = self._clock()
        waiting = [self._waiting.popleft() for _ in range(len(self._waiting))]
        lines = [self._lines.popleft() for _ in range(len(self._lines))]
        self._taken_bytes += sum(len(message.payload) for message in waiting)
        fresh = itertools.chain(
            self._transcriber.messages(self.decision_log.drain()), waiting, (self._line(*line) for line in lines)
        )
        messages = list(self._paced(fresh))
        stops, self._transcriber.stops = self._transcriber.stops, []
        self._writer.turn(messages, stops, self._transcriber.active_s, now_s)

    def finish(self) -> None:
        """Finish open files, after the last turn."""
        self._writer.close()

    def _put(self, message: RecordMessage) -> None:
        if self._put_bytes - self._taken_bytes > MAX_WAITING_BYTES:
            self._lost += 1
            self._lost_at_s = self._clock()
            return
        self._waiting.append(message)
        self._put_bytes += len(message.payload)

    def _paced(self, messages: Iterable[RecordMessage]) -> Iterator[RecordMessage]:
        for message in messages:
            self._pace()
            yield message

    def _line(self, stamp_s: float, record: logging.LogRecord) -> RecordMessage:
        fields = {"level": record.levelname, "name": record.name, "message": record.getMessage()}
        return RecordMessage(
            channels.LOG, channels.STRING, self._unix_ns(stamp_s), channels.text(json.dumps(fields).encode())
        )

    def _run(self) -> None:
        ask_for_precedence()
        while not self._ending:
            self._wake.wait(SILENT_PERIOD_S)
            self._wake.clear()
            self._pace.begin()
            self._busy_since_s = self._clock()
            self._attempt(self.turn)
            self._busy_since_s = None
        self._attempt(self.turn)
        self._attempt(self.finish)

    def _attempt(self, step: Callable[[], None]) -> None:
        """Take one step; a mistake in it is named, must not stop the car, and the next turn tries again."""
        try:
            step()
        except Exception as error:
            before, self._failure = self._failure, f"the recorder failed: {type(error).__name__}: {error}"
            self._failures += 1
            if self._failure != before:
                log.exception("the recorder failed; the car drives on, and it tries again")
        else:
            self._failure = ""

    def _words(self) -> str:
        """Return the state in a sentence."""
        report, now_s = self._writer.report, self._clock()
        if not self.is_enabled:
            return "recording is turned off (recording.enabled)"
        if self._failure:
            return f"NOT recording: {self._failure}; trying again, {self._failures} times so far"
        busy_s = now_s - self._busy_since_s if self._busy_since_s is not None else 0.0
        if busy_s > SILENT_DISK_S:
            return f"NOT recording: the disk has not answered for {busy_s:.0f} s; {self._lost} messages lost so far"
        if report.trouble:
            return f"NOT recording: {report.trouble}; trying again"
        if now_s - self._lost_at_s < LOST_LATELY_S:
            return f"the disk is too slow: {self._lost} messages lost so far"
        return f"recording: {report.why}" if report.file else f"not recording: {report.why}"


class _Pace:
    """Pauses its caller after each short stretch of work."""

    def __init__(self) -> None:
        self._until_s = 0.0

    def begin(self) -> None:
        """Begin a stretch."""
        self._until_s = time.perf_counter() + WORK_S

    def __call__(self) -> None:
        if time.perf_counter() >= self._until_s:
            time.sleep(REST_S)
            self.begin()


class _Lines(logging.Handler):
    """Keeps log records for the thread, with the monotonic time of their arrival."""

    def __init__(self, lines: deque[tuple[float, logging.LogRecord]], clock: Clock) -> None:
        super().__init__()
        self._lines = lines
        self._clock = clock

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one record."""
        self._lines.append((self._clock(), record))


_CDR_TYPES = frozenset(TYPES.values())


def _boot_id() -> str:
    """Return the identifier of this start of the computer, "" where there is none."""
    with contextlib.suppress(OSError):
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    return ""
