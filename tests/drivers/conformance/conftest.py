"""The kit's own tests run in virtual time."""

import asyncio

import pytest

from tests.wire_time import WireTimeLoop


@pytest.fixture(autouse=True)
def in_wire_time(monkeypatch):
    """Make the loops on which the kit runs its tests."""
    monkeypatch.setattr(asyncio, "new_event_loop", WireTimeLoop)
