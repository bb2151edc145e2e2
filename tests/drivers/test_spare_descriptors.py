"""A device gets a descriptor that the loop can watch, however many connections strangers hold."""

import contextlib
import os
import resource
import socket
import time

import pytest

from wallride.drivers import spare_descriptors
from wallride.drivers.address import TcpAddress
from wallride.drivers.api import LinkLost
from wallride.drivers.link import open_link


@pytest.fixture
def sensor():
    """A listening socket, as a lidar has it."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        yield TcpAddress("127.0.0.1", listener.getsockname()[1])


@pytest.fixture
def room():
    """Let this process have more descriptors than select() watches."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 2048:
        pytest.fail(f"the hard limit of descriptors is {hard}; this test needs 2048")
    resource.setrlimit(resource.RLIMIT_NOFILE, (2048, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@contextlib.contextmanager
def taken(beyond):
    """Take every descriptor up to a number, as a flood of connections does."""
    held = []
    try:
        while not held or held[-1] < beyond:
            held.append(os.open(os.devnull, os.O_RDONLY))
        yield held
    finally:
        for descriptor in held:
            os.close(descriptor)


async def test_a_device_that_reconnects_in_a_flood_is_watched(sensor, room):
    first = await open_link(sensor, time.monotonic)
    try:
        with taken(1100) as held:
            first.close()  # its number goes to the spares at once
            held.append(os.open(os.devnull, os.O_RDONLY))  # a stranger is quicker than the device
            again = await open_link(sensor, time.monotonic)
            try:
                again.listen(lambda chunk, at_s: None)
                held.append(os.open(os.devnull, os.O_RDONLY))
                assert held[-1] > 1024, "a stranger gets none of the low numbers"
            finally:
                again.close()
    finally:
        first.close()


async def test_without_a_number_left_the_device_is_lost_with_a_remedy(sensor, room, monkeypatch):
    monkeypatch.setattr(spare_descriptors, "SPARES", 0)
    with spare_descriptors.freed():
        pass
    with taken(1100), pytest.raises(LinkLost, match="too many connections"):
        await open_link(sensor, time.monotonic)
