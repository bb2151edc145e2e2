"""Times that the page promises. On a machine with more work than cores, milliseconds say nothing about the page: there
a broken promise is a skip that says so, unless it is broken by far.
"""

import logging
import os

import pytest

log = logging.getLogger("wallride.measured")

BUSY_PER_CORE = 1.5
FAR = 8


def promise(what, took_s, at_most_s):
    """Hold the page to a promise."""
    log.info("%s: %.0f ms", what, took_s * 1000)
    busy = os.getloadavg()[0]
    if took_s > at_most_s and busy > BUSY_PER_CORE * (os.cpu_count() or 1):
        assert took_s < FAR * at_most_s
        pytest.skip(f"{what} took {took_s * 1000:.0f} ms, on a machine with a load of {busy:.1f}")
    assert took_s <= at_most_s
