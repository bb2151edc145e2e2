"""A limit that ends a test whatever it waits for, the whole process with it, and names the test.

pytest-timeout raises an error in the test, once: a task that swallows its cancellation, or a thread that is joined,
then holds up the end of the event loop for ever. pytest-xdist starts another process and reports the test as failed.
"""

import faulthandler
import math
import os
import threading
from time import monotonic, sleep  # as they are now: tests put others in their place

import pytest

GRACE_S = float(os.environ.get("WALLRIDE_TEST_GRACE_S", "30"))
"""Time after the test's own limit in which it is to end by itself."""
LOOKS_EVERY_S = 0.5


class Watch:
    """One thread for all tests: a timer for each phase of each of thousands takes longer than most of them."""

    def __init__(self, stderr):
        self.name, self.ends_s = "", math.inf
        self._stderr = stderr
        threading.Thread(target=self._look, name="hard limit", daemon=True).start()

    def _look(self):
        while monotonic() < self.ends_s:
            sleep(LOOKS_EVERY_S)
        os.write(
            self._stderr, f"\n{self.name} does not end, although its time limit is over; the tests end here.\n".encode()
        )
        faulthandler.dump_traceback(self._stderr)
        os._exit(1)


WATCH = pytest.StashKey[Watch]()


def pytest_configure(config):
    """Keep the terminal's stderr: pytest captures the usual one."""
    config.stash[WATCH] = Watch(os.dup(2))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    """Limit the fixtures."""
    return (yield from _limited(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Limit the test."""
    return (yield from _limited(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item):
    """Limit the end of the fixtures, of the event loop among them."""
    return (yield from _limited(item))


def _limited(item):
    marker = item.get_closest_marker("timeout")
    limit_s = marker.args[0] if marker and marker.args else float(item.config.getini("timeout"))
    watch = item.config.stash[WATCH]
    watch.name, watch.ends_s = item.nodeid, monotonic() + limit_s + GRACE_S
    try:
        return (yield)
    finally:
        watch.ends_s = math.inf
