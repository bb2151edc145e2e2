"""The desk in either mode of the permit."""

import pytest

from tests.runtime.operator_rig import Rig
from tests.runtime.teleop.presses import BOTH


@pytest.fixture(params=BOTH)
def rig(request):
    return Rig(request.param)


@pytest.fixture
def ann(rig):
    return rig.client("Ann")


@pytest.fixture
def bob(rig, ann):
    """Who comes after Ann."""
    return rig.client("Bob")
