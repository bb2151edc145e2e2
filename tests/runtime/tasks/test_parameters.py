"""The desk on the bus, and the history in the log and on the disk."""

import asyncio
import json
import logging

import pytest

from tests.waiting import until
from wallride.runtime.parameters.history import ChangeHistory, SettingChange
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.server import ParameterServer, ServerContext
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks import parameters
from wallride.runtime.wire.network import RefusedError

KP = "wall_follow.kp"


class Switchboard:
    def __init__(self):
        self.replies = {}

    def answer(self, key, reply):
        self.replies[key] = reply


def change(number):
    return SettingChange(float(number), "a day", "ann", KP, number, number + 1)


def served(file=None):
    car = ServerContext(lambda *_: None, lambda: True, lambda: 1e9, lambda: "a day", file)
    board = Switchboard()
    desk = ParameterServer(Settings(), car, ChangeHistory(5))
    parameters.serve(board, "car1", desk, RestartDesk(lambda: "", None))
    return board.replies


def test_seven_questions_are_answered_and_nothing_else():
    names = [key.removeprefix("wallride/car1/param/") for key in served()]
    assert names == ["list", "get", "set", "save", "configure", "history", "restart"]


@pytest.mark.parametrize("name", ["list", "get", "set", "history"])
def test_nonsense_is_an_error_reply_and_not_an_exception_of_another_kind(name):
    with pytest.raises(RefusedError, match="not a question"):
        served()[f"wallride/car1/param/{name}"](b"\xff")


async def test_so_are_a_refused_save_and_a_refused_restart():
    with pytest.raises(RefusedError, match="not a question"):
        await served()["wallride/car1/param/restart"](b"\xff")
    with pytest.raises(RefusedError, match="without a settings file"):
        await served()["wallride/car1/param/save"](b"")


@pytest.fixture
async def keeping(tmp_path, monkeypatch):
    """A history that is being kept in a file, without the second's pause between two writes."""
    monkeypatch.setattr(parameters, "MIN_WRITE_PERIOD_S", 0.0)
    history, file = ChangeHistory(5), tmp_path / "history.jsonl"
    task = asyncio.create_task(parameters.keep_history(history, file))
    await asyncio.sleep(0)
    yield history, file
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_changes_are_written_down_and_read_again(keeping, caplog):
    history, file = keeping
    with caplog.at_level(logging.INFO):
        history.add([change(number) for number in range(8)])
        await until(file.exists)
        await until(lambda: file.read_text() == history.lines())
    assert [json.loads(line)["old"] for line in file.read_text().splitlines()] == [3, 4, 5, 6, 7], "the newest five"
    assert len(caplog.records) == 1, "one line for eight changes"
    assert "ann changed wall_follow.kp 5 -> 6, wall_follow.kp 6 -> 7, wall_follow.kp 7 -> 8" in caplog.text
    again = ChangeHistory(3)
    parameters.read_history(again, file)
    assert again.newest(9) == [change(5), change(6), change(7)]


async def test_a_flood_of_changes_is_a_trickle_of_lines_and_writes(tmp_path, caplog):
    history, file = ChangeHistory(5), tmp_path / "history.jsonl"
    task = asyncio.create_task(parameters.keep_history(history, file))
    await asyncio.sleep(0)
    with caplog.at_level(logging.INFO):
        for number in range(1000):
            history.add([change(number)])
            await asyncio.sleep(0)
        await until(file.exists)
    assert len(caplog.records) == 1
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_a_full_disk_is_said_and_the_car_drives_on(tmp_path, caplog):
    history = ChangeHistory(5)
    task = asyncio.create_task(parameters.keep_history(history, tmp_path / "nowhere" / "history.jsonl"))
    await asyncio.sleep(0)
    history.add([change(1)])
    await until(lambda: "No such file" in caplog.text)
    assert not task.done()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def test_a_damaged_history_is_read_as_far_as_it_goes(tmp_path, caplog):
    file = tmp_path / "history.jsonl"
    history = ChangeHistory(5)
    parameters.read_history(history, file)
    history.add([change(1)])
    file.write_bytes(b"\xff\xfe\n[]\n{}\n" + b"[" * 5000 + b"\n" + history.lines().encode() + b'{"half": ')
    again = ChangeHistory(5)
    parameters.read_history(again, file)
    assert again.newest(5) == [change(1)]
    assert "5 lines are no changes" in caplog.text
    parameters.read_history(again, tmp_path)
    assert "cannot be read" in caplog.text
