"""Runs that many tests read."""

import json

import pytest

from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.run import run_of


@pytest.fixture(scope="session")
def path(dead_end):
    return dead_end


@pytest.fixture(scope="session")
def run(path):
    return run_of(read_log(path))


@pytest.fixture(scope="session")
def last_status(path):
    """What the car itself said at the end."""
    return json.loads(read_log(path).of("status")[-1].payload)
