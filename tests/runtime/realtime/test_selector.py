"""The car's selector answers what the standard library's answers."""

import asyncio
import errno
import fcntl
import os
import selectors
import socket

import pytest

from runtime.launch import punctual_loop
from runtime.realtime.selector import ReadySelector

READ, WRITE = selectors.EVENT_READ, selectors.EVENT_WRITE


@pytest.fixture
def ports():
    """Two connected sockets, the first of which has something to read."""
    near, far = socket.socketpair()
    with near, far:
        far.send(b"x")
        yield near, far


def answer(selector):
    return {(key.fd, key.data, events) for key, events in selector.select(0)}


@pytest.mark.parametrize("events", [READ, WRITE, READ | WRITE])
def test_it_answers_as_the_standard_one(ports, events):
    near, far = ports
    with ReadySelector() as few, selectors.SelectSelector() as standard:
        for selector in (few, standard):
            selector.register(near, events, "near")
            selector.register(far, events, "far")
        assert answer(few) == answer(standard)
        for selector in (few, standard):
            selector.modify(near, READ, "only to read")
            selector.modify(far, READ | WRITE, "far")
        assert answer(few) == answer(standard)
        assert few.get_key(near).data == "only to read"
        for selector in (few, standard):
            selector.unregister(near)
        assert answer(few) == answer(standard)


def test_nobody_ready_is_nobody_after_the_time_given(ports):
    near, _ = ports
    near.recv(1)
    with ReadySelector() as few:
        few.register(near, READ)
        assert few.select(0.001) == []
        assert few.select(-1.0) == []


def test_who_is_watched_already_or_not_at_all_is_refused(ports):
    near, far = ports
    with ReadySelector() as few:
        few.register(near, READ)
        with pytest.raises(KeyError):
            few.register(near, READ)
        with pytest.raises(KeyError):
            few.unregister(far)
        assert [key.fileobj for key, _ in few.select(0)] == [near]


def test_a_descriptor_that_select_cannot_watch_is_refused_at_once(ports):
    near, _ = ports
    high = fcntl.fcntl(near, fcntl.F_DUPFD, 1024)
    try:
        with ReadySelector() as few:
            with pytest.raises(OSError, match="1024") as refused:
                few.register(high, READ)
            assert refused.value.errno == errno.EMFILE
            few.register(near, READ)
            assert [key.fd for key, _ in few.select(0)] == [near.fileno()]
    finally:
        os.close(high)


def test_the_cars_loop_reads_and_writes_with_it():
    async def story():
        async def echo(reader, writer):
            writer.write(await reader.readexactly(1 << 20))  # more than a socket takes at once
            await writer.drain()
            writer.close()

        async with await asyncio.start_server(echo, "127.0.0.1", 0, limit=1 << 21) as server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname()[:2])
            writer.write(bytes(1 << 20))
            answer = await reader.readexactly(1 << 20)
            writer.close()
            return len(answer)

    with asyncio.Runner(loop_factory=punctual_loop) as runner:
        assert runner.run(story()) == 1 << 20
