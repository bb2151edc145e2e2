"""A limit that ends a test whatever it waits for, the whole process with it, and names the test.

pytest-timeout raises an error in the test, once: a task that swallows its cancellation, or a thread that is joined,
then holds up the end of the event loop for ever. pytest-xdist starts another process and reports the test as failed.
"""

import faulthandler
import os
import threading

import pytest

GRACE_S = float(os.environ.get("WALLRIDE_TEST_GRACE_S", "30"))
"""Time after the test's own limit in which it is to end by itself."""
STDERR = pytest.StashKey[int]()


def pytest_configure(config):
    """Keep the terminal's stderr: pytest captures the usual one."""
    config.stash[STDERR] = os.dup(2)


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
    timer = threading.Timer(limit_s + GRACE_S, _end, (item.nodeid, item.config.stash[STDERR]))
    timer.daemon = True
    timer.start()
    try:
        return (yield)
    finally:
        timer.cancel()


def _end(name, stderr):
    os.write(stderr, f"\n{name} does not end, although its time limit is over; the tests end here.\n".encode())
    faulthandler.dump_traceback(stderr)
    os._exit(1)
