"""The changes of an emulated controller are made in virtual time; the command's own process is not."""

from tests import wire_time

pytest_asyncio_loop_factories = wire_time.chosen_for("test_change.py")
