"""A new start of a car on request: when it is refused, and how the process starts again."""

import asyncio
import json
import os
import sys

import pytest

from wallride.runtime import restarting
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.restarting import ProcessRestart, start_again

DRIVES = "only while the car stands; stop it first"


class Process:
    """A process that notes what is done with it. spoils: called while its files are read."""

    def __init__(self, spoils=lambda: None):
        self.checked, self.begun, self.spoils = 0, 0, spoils

    def check(self):
        self.checked += 1
        self.spoils()

    def begin(self):
        self.begun += 1


async def asked(desk, **question):
    return json.loads(await desk.receive(json.dumps(question).encode()))


async def test_a_car_that_stands_is_started_anew_once():
    process = Process()
    desk = RestartDesk(lambda: "", process)
    assert await asked(desk, only_ask=True) == {"restarts": False}
    assert (process.checked, process.begun) == (0, 0)
    assert await asked(desk, by="ann") == {"restarts": True}
    with pytest.raises(UnacceptableError, match="restarted already"):
        await asked(desk)
    assert (process.checked, process.begun) == (1, 1)


async def test_two_at_once_are_one():
    process = Process()
    desk = RestartDesk(lambda: "", process)
    answers = await asyncio.gather(asked(desk), asked(desk), return_exceptions=True)
    assert [isinstance(one, UnacceptableError) for one in answers] == [False, True]
    assert process.begun == 1


@pytest.mark.parametrize("only_ask", [False, True])
async def test_a_car_that_drives_is_not(only_ask):
    process = Process()
    with pytest.raises(UnacceptableError, match=f"^no restart: {DRIVES}$"):
        await asked(RestartDesk(lambda: DRIVES, process), only_ask=only_ask)
    assert process.checked == 0


async def test_a_car_that_drove_off_while_its_files_were_read_is_not():
    objections = []
    process = Process(lambda: objections.append(DRIVES))
    desk = RestartDesk(lambda: objections[0] if objections else "", process)
    with pytest.raises(UnacceptableError, match=DRIVES):
        await asked(desk)
    assert process.begun == 0
    objections.clear()
    process.spoils = lambda: None
    assert await asked(desk) == {"restarts": True}, "a refusal is no end"


@pytest.mark.parametrize("payload", [b"\xff", b"[]", b'{"now": 1}', b'{"only_ask": 1}', b" " * 5000])
async def test_nonsense_is_refused(payload):
    process = Process()
    with pytest.raises(UnacceptableError, match="question"):
        await RestartDesk(lambda: "", process).receive(payload)
    assert process.begun == 0


@pytest.mark.parametrize(
    ("text", "assignments", "said"),
    [
        ("[wall_follow]\nkp = 99\n", (), "would not start: .*kp"),
        ('[map]\nfile = "gone.yaml"\n', (), "would not start: .*gone.yaml"),
        ('[wall_follow]\nmethod = "line"\n', (), "map.file names none"),
        ("", ("operator.permit=always",), "drive as soon as it has started"),
    ],
)
def test_what_keeps_a_car_from_starting_is_said_before_it_ends(tmp_path, text, assignments, said):
    file = tmp_path / "car.toml"
    file.write_text(text)
    with pytest.raises(UnacceptableError, match=f"no restart: .*{said}"):
        ProcessRestart(file, None, assignments).check()
    file.write_text("")
    ProcessRestart(file, None, ()).check()


def test_the_end_is_asked_for_and_a_start_wanted():
    restart, ends = ProcessRestart(None, None, ()), []
    restart.end = lambda: ends.append("stop")
    assert not restart.wanted
    restart.begin()
    assert (restart.wanted, ends) == (True, ["stop"])


def test_a_process_takes_its_own_place_and_a_service_is_started_by_its_manager(monkeypatch):
    started = []
    monkeypatch.setattr(os, "execv", lambda program, words: started.append((program, words)))
    assert restarting.start_again({"NOTIFY_SOCKET": "/run/notify"}) == 0
    assert started == []
    start_again({})
    assert started == [(sys.executable, sys.orig_argv)]
