"""The inbox: the newest value, taken once, never a backlog."""

import asyncio
import contextvars

import pytest

from wallride.runtime.arbitration.inbox import Inbox


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


async def until(condition, turns=20):
    for _ in range(turns):
        if condition():
            return
        await asyncio.sleep(0)
    raise AssertionError("it did not happen")


async def reading(inbox, taken):
    while True:
        taken.append((await inbox.get(), asyncio.current_task().get_name()))


async def test_a_value_put_outside_any_task_is_taken_before_put_returns():
    inbox, taken, seen = Inbox(), [], []
    reader = asyncio.create_task(reading(inbox, taken), name="reader")
    await asyncio.sleep(0)

    def callback():
        for value in (1, 2):
            inbox.put(value)
            seen.append(list(taken))

    asyncio.get_running_loop().call_soon(callback)
    await until(lambda: seen)
    assert seen == [[(1, "reader")], [(1, "reader"), (2, "reader")]]
    reader.cancel()
    assert isinstance((await asyncio.gather(reader, return_exceptions=True))[0], asyncio.CancelledError)


async def test_an_error_of_the_reader_stays_in_its_task():
    inbox, went_on = Inbox(), []

    async def failing():
        raise ValueError(await inbox.get())

    reader = asyncio.create_task(failing())
    await asyncio.sleep(0)

    def callback():
        inbox.put("bad")
        went_on.append(reader.done())

    asyncio.get_running_loop().call_soon(callback)
    await until(lambda: went_on)
    assert went_on == [True]
    with pytest.raises(ValueError, match="bad"):
        reader.result()


async def test_a_cancellation_and_a_value_at_once_lose_neither_the_end_nor_the_next_value():
    inbox, taken = Inbox(), []
    reader = asyncio.create_task(reading(inbox, taken))
    await asyncio.sleep(0)

    def callback():
        reader.cancel()
        inbox.put(1)

    asyncio.get_running_loop().call_soon(callback)
    await until(reader.done)
    assert reader.cancelled()
    assert not taken
    assert await inbox.get() == 1


async def test_a_reader_keeps_its_own_context():
    variable, inbox, taken = contextvars.ContextVar("variable"), Inbox(), []

    async def reads():
        variable.set("its own")
        await inbox.get()
        taken.append(variable.get())

    reader = asyncio.create_task(reads())
    await asyncio.sleep(0)
    asyncio.get_running_loop().call_soon(inbox.put, 1)
    await reader
    assert taken == ["its own"]
