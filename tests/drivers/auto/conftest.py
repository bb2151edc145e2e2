"""The tests of this folder run in virtual time."""

from tests import wire_time

pytest_asyncio_loop_factories = wire_time.chosen
