"""Runs that many tests read."""

import json

import pytest

from tests.sim.replay.recorded import record
from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.run import run_of

DRIVE = {"world": "dead_end", "seconds": 9.0, "sections": {"wall_follow": {"speed_mps": 2.0}}}


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """A drive into a dead end, its file, and the car that drove it."""
    path = tmp_path_factory.mktemp("runs") / "drive.mcap"
    car, _ = record(path, **DRIVE)
    return path, car


@pytest.fixture(scope="session")
def path(drive):
    return drive[0]


@pytest.fixture(scope="session")
def run(path):
    return run_of(read_log(path))


@pytest.fixture(scope="session")
def last_status(path):
    """What the car itself said at the end."""
    return json.loads(read_log(path).of("status")[-1].payload)
