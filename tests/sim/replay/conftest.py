"""A recording that many tests read."""

import pytest

from wallride.sim.replay.drive_log import read_log


@pytest.fixture(scope="session")
def log(dead_end):
    return read_log(dead_end)
