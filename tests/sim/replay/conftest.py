"""A foreign recording that many tests read."""

from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def carried_bag() -> Path:
    return REPOSITORY / "tests" / "data" / "urg04lx_people_40.bag"
