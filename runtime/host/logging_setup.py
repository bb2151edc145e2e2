"""Logging set-up: one line an event on standard error, as text or JSON, written by a thread.

A blocked terminal or a full journal must not block control, so records go through a queue (QueueHandler).
"""

import json
import logging
import logging.handlers
import queue
from collections.abc import Iterator
from contextlib import contextmanager


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


@contextmanager
def journal(level: str, form: str) -> Iterator[None]:
    """Log to standard error inside the block; queued records are still written at its end."""
    handler = logging.StreamHandler()
    handler.setFormatter(
        _JsonFormatter()
        if form == "json"
        else logging.Formatter("%(asctime)s.%(msecs)03d %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S")
    )
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = logging.handlers.QueueListener(records, handler)
    root = logging.getLogger()
    queue_handler = logging.handlers.QueueHandler(records)
    root.addHandler(queue_handler)
    root.setLevel(level)
    listener.start()
    try:
        yield
    finally:
        root.removeHandler(queue_handler)
        listener.stop()
