"""A client ends after Ctrl-C although a task loses its cancellation, or an orderly end waits for ever."""

import signal
import subprocess
import sys

import pytest

PROGRAM = """
import asyncio
from wallride.clients import ending

async def deaf():
    while True:
        try:
            await asyncio.sleep(3600)
        except asyncio.CancelledError:
            pass

async def sleeps():
    await asyncio.sleep(3600)

async def hangs():
    await ending.interrupted()
    await deaf()

async def program():
    print("runs", flush=True)
    await {}()
    return 0

raise SystemExit(ending.run_to_end(program()))
"""


@pytest.mark.parametrize("body", ["deaf", "hangs", "sleeps"])
def test_a_client_ends_although_a_task_does_not(body):
    program = PROGRAM.format(body)
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as client:
        assert client.stdout.readline() == b"runs\n"
        client.send_signal(signal.SIGINT)
        assert client.wait(30) == 130
