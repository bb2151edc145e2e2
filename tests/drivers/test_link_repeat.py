"""A job that is repeated on a link: after the pauses that it asks for, and no longer than the link lives."""

import asyncio
import socket
import struct
import time
from contextlib import suppress

import pytest

from wallride.drivers.address import TcpAddress
from wallride.drivers.api import LinkLost
from wallride.drivers.link import open_link


@pytest.fixture
async def ends():
    with socket.create_server(("127.0.0.1", 0)) as door:
        link = await open_link(TcpAddress("127.0.0.1", door.getsockname()[1]), time.monotonic)
        far, _ = door.accept()
        link.listen(lambda _chunk, _at_s: None)
        with far:
            yield link, far
        link.close()


class EnoughError(Exception):
    """Ends a job."""


def job(pauses_s):
    """Return a job that asks for these pauses and then has enough, and when it was called."""
    called_s, left_s = [], list(pauses_s)

    def call():
        called_s.append(time.monotonic())
        if not left_s:
            raise EnoughError
        return left_s.pop(0)

    return call, called_s


async def test_it_pauses_as_long_as_asked_and_the_jobs_error_ends_it(ends):
    link, _ = ends
    call, called_s = job([0.03, 0.01])
    with pytest.raises(EnoughError):
        async with asyncio.timeout(5.0):
            await link.repeat(call)
    first_s, second_s, third_s = called_s
    assert second_s - first_s >= 0.03
    assert third_s - second_s >= 0.01


async def test_a_loss_ends_it_with_the_reason(ends):
    link, far = ends
    asyncio.get_running_loop().call_later(0.01, far.close)
    with pytest.raises(LinkLost, match="closed it"):
        async with asyncio.timeout(5.0):
            await link.repeat(lambda: 10.0)


async def test_a_loss_in_the_job_is_told_once_and_as_what_it_is(ends, caplog):
    link, far = ends
    call, called_s = job([])

    def write():
        far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # its close is a reset
        far.close()
        with suppress(LinkLost):
            link.write(b"x")
        return call()

    with pytest.raises(LinkLost, match="reset"):
        async with asyncio.timeout(5.0):
            await link.repeat(write)
    assert len(called_s) == 1
    assert not caplog.records


async def test_on_a_lost_link_nothing_is_called(ends):
    link, far = ends
    far.close()
    with pytest.raises(LinkLost):
        async with asyncio.timeout(5.0):
            await link.repeat(lambda: 10.0)
    with pytest.raises(LinkLost):
        async with asyncio.timeout(5.0):
            await link.repeat(lambda: pytest.fail("it was called"))


async def test_who_is_cancelled_calls_no_more_and_may_begin_again(ends):
    link, _ = ends
    call, called_s = job([0.001] * 1000)
    repeating = asyncio.create_task(link.repeat(call))
    await asyncio.sleep(0.01)
    repeating.cancel()
    await asyncio.gather(repeating, return_exceptions=True)
    before = len(called_s)
    again, _ = job([0.01])
    with pytest.raises(EnoughError):
        await link.repeat(again)
    assert len(called_s) == before


async def test_reading_takes_time_that_is_told(ends):
    link, far = ends
    came = asyncio.Event()
    link.listen(lambda _chunk, _at_s: came.set())
    far.sendall(b"x")
    async with asyncio.timeout(5.0):
        await came.wait()
    assert 0 < link.reading_s < 5
