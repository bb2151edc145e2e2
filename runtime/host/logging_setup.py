"""Logging set-up: one line an event on standard error, as text or JSON, written by a thread.

A blocked terminal or a full journal must not block control, so records go through a queue (QueueHandler) of bounded
length, and the end of the process does not wait for a reader that is gone.
"""

import json
import logging
import logging.handlers
import os
import queue
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from wallride.runtime.host.scheduling import ask_for_precedence
from wallride.runtime.host.terminal_text import one_line

MAX_WAITING: Final = 2000
"""Maximum number of records that wait for a blocked terminal; newer ones are dropped."""
MAX_LAST_WRITE_S: Final = 0.5
"""Maximum time for the queued records at the end of the process."""


class _JsonFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return json.dumps(
            {
                "time": self.formatTime(record),
                "level": record.levelname,
                "name": record.name,
                "message": record.getMessage(),
            }
        )


class _LineFormatter(logging.Formatter):
    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - the name is the base class's
        """Return the line: no name or reason from outside ends it and begins another one."""
        record.message = one_line(record.message)
        return super().formatMessage(record)


class _DescriptorHandler(logging.Handler):
    """Writes to a file descriptor without any lock: one thread writes, and a blocked write must not hold up the exit.

    Python's own buffers and the locks of logging are both waited for when the interpreter ends.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__()
        self._descriptor = descriptor

    def createLock(self) -> None:  # noqa: N802 - the name is the base class's
        """Use no lock."""
        self.lock = None

    def handle(self, record: logging.LogRecord) -> bool:
        """Write a record that passes the filters. The base class takes a lock, and from Python 3.13 on needs one."""
        passed = bool(self.filter(record))
        if passed:
            self.emit(record)
        return passed

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line; a line that cannot be written is lost."""
        try:
            os.write(self._descriptor, f"{self.format(record)}\n".encode(errors="replace"))
        except OSError:
            return  # the reader is gone


class _BoundedQueueHandler(logging.handlers.QueueHandler):
    def __init__(self, records: queue.SimpleQueue[logging.LogRecord]) -> None:
        super().__init__(records)
        self._records = records

    def enqueue(self, record: logging.LogRecord) -> None:
        """Queue a record, or drop it where the terminal is blocked."""
        if self._records.qsize() < MAX_WAITING:
            self._records.put(record)


class _PatientListener(logging.handlers.QueueListener):
    def _monitor(self) -> None:
        """Write records, in a thread of its own."""
        ask_for_precedence()
        super()._monitor()  # type: ignore[misc]

    def stop(self) -> None:
        """Write what is queued, for a limited time."""
        self.enqueue_sentinel()
        if self._thread is not None:
            self._thread.join(MAX_LAST_WRITE_S)
            self._thread = None


@contextmanager
def journal(level: str, form: str) -> Iterator[None]:
    """Log to standard error inside the block; queued records are still written at its end."""
    handler = _DescriptorHandler(sys.stderr.fileno())
    handler.setFormatter(
        _JsonFormatter()
        if form == "json"
        else _LineFormatter("%(asctime)s.%(msecs)03d %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S")
    )
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = _PatientListener(records, handler)
    root = logging.getLogger()
    queue_handler = _BoundedQueueHandler(records)
    root.addHandler(queue_handler)
    root.setLevel(level)
    listener.start()
    try:
        yield
    finally:
        root.removeHandler(queue_handler)
        listener.stop()
