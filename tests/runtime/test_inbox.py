"""The inbox: the newest value, taken once, never a backlog."""

import asyncio

import pytest

from wallride.runtime.arbitration.queues import Inbox


class HandClock:
    now_s = 0.0

    def __call__(self):
        return self.now_s


async def test_the_newest_is_taken_once():
    inbox = Inbox(HandClock())
    inbox.put(1)
    inbox.put(2)
    assert await inbox.get() == 2
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await inbox.get()


async def test_a_waiting_reader_gets_the_newest_of_a_burst():
    inbox = Inbox(HandClock())
    reader = asyncio.create_task(inbox.get())
    await asyncio.sleep(0)
    inbox.put(1)
    inbox.put(2)
    assert await reader == 2


async def test_what_expired_is_not_handed_out():
    clock = HandClock()
    inbox = Inbox(clock)
    inbox.put(1, expires_at_s=1.0)
    clock.now_s = 1.0
    reader = asyncio.create_task(inbox.get())
    await asyncio.sleep(0)
    assert not reader.done()
    inbox.put(None, expires_at_s=2.0)
    assert await reader is None


async def test_a_cancelled_reader_leaves_the_inbox_usable():
    inbox = Inbox(HandClock())
    reader = asyncio.create_task(inbox.get())
    await asyncio.sleep(0)
    reader.cancel()
    await asyncio.gather(reader, return_exceptions=True)
    inbox.put(1)
    assert await inbox.get() == 1


async def test_a_reader_waits_as_often_as_it_likes():
    inbox = Inbox(HandClock())
    for value in (1, 2):
        reader = asyncio.create_task(inbox.get())
        await asyncio.sleep(0)
        inbox.put(value)
        assert await reader == value
