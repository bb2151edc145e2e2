"""The log: lines on standard error, and a blocked terminal that holds up nothing."""

import json
import logging
import os
import subprocess
import sys
import time

import pytest

from wallride.runtime.host.logging_setup import MAX_WAITING, _LineFormatter, journal

BLOCKED = """
import logging
from wallride.runtime.host.logging_setup import journal
with journal("INFO", "text"):
    for number in range(8_000):
        logging.getLogger("wallride").info("a line of the log, number %d", number)
"""


@pytest.mark.parametrize("form", ["text", "json"])
def test_each_event_is_a_line(form, capfd):
    with journal("INFO", form):
        logging.getLogger("wallride.test").warning("the motor is %s", "gone")
        logging.getLogger("wallride.test").debug("not shown")
    (line,) = [line for line in capfd.readouterr().err.splitlines() if "motor" in line]
    if form == "json":
        assert json.loads(line)["message"] == "the motor is gone"
    else:
        assert line.endswith("WARNING wallride.test: the motor is gone")


def test_lines_are_written_without_a_lock_by_every_python(monkeypatch, capfd):
    """From Python 3.13 on `Handler.handle` fails without a lock, and the thread that writes the log ended with it."""

    def handle(handler, record):
        with handler.lock:
            handler.emit(record)

    monkeypatch.setattr(logging.Handler, "handle", handle)
    with journal("INFO", "text"):
        logging.getLogger("wallride.test").warning("the motor is gone")
    assert "the motor is gone" in capfd.readouterr().err


def test_a_terminal_that_reads_nothing_holds_up_neither_the_process_nor_its_end():
    ours, theirs = os.pipe()
    began_s = time.monotonic()
    done = subprocess.run([sys.executable, "-c", BLOCKED], stderr=theirs, timeout=30, check=False)
    os.close(theirs)
    assert done.returncode == 0
    assert time.monotonic() - began_s < 25
    assert len(os.read(ours, 1 << 20)) > 10_000
    os.close(ours)
    assert MAX_WAITING < 8_000


def test_no_text_from_outside_begins_a_line_of_its_own():
    record = logging.LogRecord("wallride", logging.INFO, "", 0, "e-stop by %s", ("eve\n12:00:00 forged\x1b[2J",), None)
    line = _LineFormatter("%(levelname)s %(message)s").format(record)
    assert line == r"INFO e-stop by eve\n12:00:00 forged\x1b[2J"
