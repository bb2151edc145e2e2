"""The inbox: the newest value, taken once, never a backlog."""

import asyncio

import pytest

from wallride.runtime.arbitration.queues import Inbox


async def test_the_newest_is_taken_once():
    inbox = Inbox()
    inbox.put(1)
    inbox.put(2)
    assert await inbox.get() == 2
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await inbox.get()


async def test_a_waiting_reader_gets_the_newest_of_a_burst():
    inbox = Inbox()
    reader = asyncio.create_task(inbox.get())
    await asyncio.sleep(0)
    inbox.put(1)
    inbox.put(2)
    assert await reader == 2


async def test_a_cancelled_reader_leaves_the_inbox_usable():
    inbox = Inbox()
    reader = asyncio.create_task(inbox.get())
    await asyncio.sleep(0)
    reader.cancel()
    await asyncio.gather(reader, return_exceptions=True)
    inbox.put(1)
    assert await inbox.get() == 1


async def test_a_reader_waits_as_often_as_it_likes():
    inbox = Inbox()
    for value in (1, 2):
        reader = asyncio.create_task(inbox.get())
        await asyncio.sleep(0)
        inbox.put(value)
        assert await reader == value
