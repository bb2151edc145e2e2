"""Bounds on times that tests measure on the wall clock: the one place that says what a busy machine may do to them.

Rules are tested in virtual time. On a machine with more work than cores a measured time says little about the program:
there an exceeded bound is a skip that names the time, unless it is exceeded FAR times.
"""

import logging
import os

import pytest

log = logging.getLogger("wallride.measured")

BUSY_PER_CORE = 1.5
"""Minimum load per core of a busy machine."""
FAR = 8
"""Maximum multiple of the bound on a busy machine."""


def promise(what, took_s, at_most_s):
    """Assert that what took took_s took at most at_most_s."""
    log.info("%s: %.0f ms", what, took_s * 1000)
    busy = os.getloadavg()[0]
    if took_s > at_most_s and busy > BUSY_PER_CORE * (os.cpu_count() or 1):
        assert took_s < FAR * at_most_s
        pytest.skip(f"{what} took {took_s * 1000:.0f} ms, on a machine with a load of {busy:.1f}")
    assert took_s <= at_most_s
