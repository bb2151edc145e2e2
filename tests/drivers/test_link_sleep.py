"""Sleeping on a link: as long as it was asked to, and not a moment longer than the link lives."""

import asyncio
import socket
import time

import pytest

from drivers.address import TcpAddress
from drivers.api import LinkLost
from drivers.link import open_link


@pytest.fixture
async def ends():
    with socket.create_server(("127.0.0.1", 0)) as door:
        link = await open_link(TcpAddress("127.0.0.1", door.getsockname()[1]), time.monotonic)
        far, _ = door.accept()
        link.listen(lambda _chunk, _at_s: None)
        with far:
            yield link, far
        link.close()


async def test_it_lasts_as_long_as_asked(ends):
    link, _ = ends
    asked_s = time.monotonic()
    await link.sleep(0.03)
    assert time.monotonic() - asked_s >= 0.03


async def test_a_loss_ends_it_with_the_reason(ends):
    link, far = ends
    asyncio.get_running_loop().call_later(0.01, far.close)
    with pytest.raises(LinkLost, match="closed it"):
        await asyncio.wait_for(link.sleep(10.0), 5.0)


async def test_a_lost_link_lets_nobody_sleep(ends):
    link, far = ends
    far.close()
    with pytest.raises(LinkLost):
        await asyncio.wait_for(link.sleep(10.0), 5.0)
    with pytest.raises(LinkLost):
        await asyncio.wait_for(link.sleep(10.0), 5.0)


async def test_a_cancelled_sleeper_can_sleep_again(ends):
    link, _ = ends
    sleeper = asyncio.create_task(link.sleep(10.0))
    await asyncio.sleep(0)
    sleeper.cancel()
    await asyncio.gather(sleeper, return_exceptions=True)
    await link.sleep(0.001)


async def test_reading_takes_time_that_is_told(ends):
    link, far = ends
    came = asyncio.Event()
    link.listen(lambda _chunk, _at_s: came.set())
    far.sendall(b"x")
    await asyncio.wait_for(came.wait(), 5.0)
    assert 0 < link.reading_s < 5
