"""Emulated lidars and boards are opened in virtual time."""

from tests import wire_time

pytest_asyncio_loop_factories = wire_time.chosen_for("test_devices.py")
