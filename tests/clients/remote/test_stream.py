"""Iterators: bounded, in order, for two kinds of loops, and with an end for a silent car."""

import asyncio
import threading

import pytest

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.stream import Stream


def stream(buffer=10, timeout_s=5.0):
    return Stream(lambda raw: raw[1], buffer=buffer, timeout_s=timeout_s, silent="car1 says nothing")


def put(stream, *payloads):
    for payload in payloads:
        stream.put(("scan", payload, 0.0))


def test_messages_come_in_their_order_until_it_is_closed():
    one = stream()
    put(one, b"1", b"2")
    one.close()
    assert list(one) == [b"1", b"2"]


def test_a_reader_that_is_late_loses_the_oldest_and_knows_how_many():
    one = stream(buffer=2)
    put(one, b"1", b"2", b"3", b"4")
    one.close()
    assert (list(one), one.dropped) == ([b"3", b"4"], 2)


def test_the_newest_alone_where_a_controller_wants_it():
    one = stream(buffer=1)
    put(one, b"1", b"2")
    assert next(one) == b"2"


def test_silence_ends_with_the_reason():
    with pytest.raises(ConnectionProblemError, match="car1 says nothing"):
        next(stream(timeout_s=0.01))


def test_a_reader_that_waits_is_woken_by_another_thread():
    one = stream()
    threading.Timer(0.01, put, (one, b"1")).start()
    assert next(one) == b"1"


async def test_an_async_reader_is_woken_by_another_thread_and_by_the_end():
    one, got = stream(), []

    async def read():
        got.extend([payload async for payload in one])

    reading = asyncio.create_task(read())
    await asyncio.sleep(0)
    await asyncio.to_thread(put, one, b"1", b"2")
    await asyncio.to_thread(one.close)
    await reading
    assert got == [b"1", b"2"]


async def test_silence_ends_an_async_reader_too():
    with pytest.raises(ConnectionProblemError, match="car1 says nothing"):
        await anext(stream(timeout_s=0.01))
