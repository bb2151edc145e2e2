"""Drives that many tests read."""

from pathlib import Path

import pytest

from tests.sim.replay.recorded import record

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def carried_bag() -> Path:
    return REPOSITORY / "tests" / "data" / "urg04lx_people_40.bag"


@pytest.fixture(scope="session")
def dead_end(tmp_path_factory) -> Path:
    """A drive into a dead end at 2 m/s: safety slows it, stops it, and it backs out."""
    path: Path = tmp_path_factory.mktemp("drives") / "dead_end.mcap"
    record(path, world="dead_end", seconds=9.0, sections={"wall_follow": {"speed_mps": 2.0}})
    return path
