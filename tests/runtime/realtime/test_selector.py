"""The car's selector refuses a descriptor that it cannot watch, and its loop goes on."""

import asyncio
import errno
import fcntl
import os
import selectors
import socket

import pytest

from wallride.runtime.launch import PunctualLoop
from wallride.runtime.realtime.selector import CheckedSelector

READ = selectors.EVENT_READ


@pytest.fixture
def ports():
    """Two connected sockets, the first of which has something to read."""
    near, far = socket.socketpair()
    with near, far:
        far.send(b"x")
        yield near, far


def test_a_descriptor_that_select_cannot_watch_is_refused_at_once(ports):
    near, _ = ports
    high = fcntl.fcntl(near, fcntl.F_DUPFD, 1024)
    try:
        with CheckedSelector() as selector:
            with pytest.raises(OSError, match="1024") as refused:
                selector.register(high, READ)
            assert refused.value.errno == errno.EMFILE
            selector.register(near, READ)
            assert [key.fd for key, _ in selector.select(0)] == [near.fileno()]
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

    with asyncio.Runner(loop_factory=PunctualLoop) as runner:
        assert runner.run(story()) == 1 << 20
