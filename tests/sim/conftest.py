"""The shared recordings, where they are, and a drive that many tests read."""

import logging
from pathlib import Path

import pytest

from tests.sim.replay.recorded import record

DEAD_END = {"world": "dead_end", "seconds": 9.0, "sections": {"wall_follow": {"speed_mps": 2.0}}}
REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    folder = REPOSITORY / ".." / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the folder shared/data with the recordings of other people is not beside this repository")
    return folder


@pytest.fixture(scope="session")
def carried_bag() -> Path:
    return REPOSITORY / "tests" / "data" / "urg04lx_people_40.bag"


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """A drive into a dead end, in which safety slows and stops the car: its file, the car, and what the mux logged."""
    logged: list[str] = []
    path = tmp_path_factory.mktemp("drives") / "drive.mcap"
    with pytest.MonkeyPatch.context() as patch:
        mux = logging.getLogger("wallride.mux")
        patch.setattr(mux, "info", lambda text, *parts: logged.append(text % parts))
        car, _ = record(path, **DEAD_END)
    return path, car, logged


@pytest.fixture(scope="session")
def dead_end(drive) -> Path:
    path: Path = drive[0]
    return path
