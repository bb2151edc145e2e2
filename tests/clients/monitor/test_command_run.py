"""Commands beside the monitor: their answers, their place in the queue for the processor, and their end."""

import asyncio
import os

import pytest

from tests.waiting import until
from wallride.clients.monitor import command_run
from wallride.clients.monitor.command_run import (
    LOWEST_PRIORITY,
    MAX_ANSWER_B,
    CommandAnswer,
    CommandFailedError,
    run_command,
)

ENDLESS = (["0", "--bind", "127.0.0.1"], "http.server")
"""A program of Python itself that does not end, and needs nothing."""


async def test_a_command_answers():
    answer = await run_command(["--version"], 120.0)
    assert answer.code == 0
    assert answer.out.startswith("wallride ")


async def test_a_mistake_of_a_command_is_its_sentence(tmp_path):
    answer = await run_command(["logs", "info", str(tmp_path / "none.mcap")], 120.0)
    assert answer.code == 2
    assert answer.reason.startswith(f"{tmp_path}/none.mcap: no such file here")


@pytest.mark.parametrize(
    ("err", "reason"),
    [
        ("a warning\nwallride: no recording\nmore\n", "no recording"),
        ("Traceback\n\nKilled\n", "Killed"),
        ("", "it ended with exit code 3"),
    ],
)
def test_the_reason_is_the_best_that_was_said(err, reason):
    assert CommandAnswer(3, "", err).reason == reason


async def test_of_a_flood_of_words_the_end_is_kept():
    stream = asyncio.StreamReader()
    stream.feed_data(b"x" * 3 * MAX_ANSWER_B + b"the end")
    stream.feed_eof()
    kept = await command_run._end_of(stream)
    assert len(kept) == MAX_ANSWER_B
    assert kept.endswith("the end")


@pytest.fixture
def started(monkeypatch):
    """Process id and priority of each command that is started."""
    first, seen = command_run._let_others_go_first, []

    def note(pid):
        first(pid)
        seen.append((pid, os.getpriority(os.PRIO_PROCESS, pid)))

    monkeypatch.setattr(command_run, "_let_others_go_first", note)
    return seen


async def test_a_cancelled_command_is_ended_and_ran_last_in_turn(started):
    words, program = ENDLESS
    task = asyncio.create_task(run_command(words, 120.0, program))
    await until(lambda: started, 30)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    ((pid, priority),) = started
    assert priority == LOWEST_PRIORITY
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


async def test_a_command_that_does_not_end_is_ended(started):
    words, program = ENDLESS
    with pytest.raises(CommandFailedError, match="did not end within"):
        await run_command(words, 0.1, program)
    with pytest.raises(ProcessLookupError):
        os.kill(started[0][0], 0)
