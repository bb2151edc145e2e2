"""A car that was taken over says odd things to every command: each ends with a sentence, in printable lines."""

import asyncio
import contextlib
import json

import pytest

from tests.clients.speaking_car import CarSession
from wallride.cli import main
from wallride.runtime.recording import requests
from wallride.runtime.wire import topics

EVIL = "\x1b[2J\x1b]0;owned\x07\n12:00:00 INFO forged: all is well\r\u202e\x9b31m"
TEXTS = {
    "parameters": [{
        "name": EVIL, "value": EVIL, "default": "", "range": EVIL, "takes_effect": "now", "description": EVIL
    }],
    "values": {EVIL: EVIL, "b": 1}, "changes": [dict.fromkeys(("at", "by", "name", "old", "new"), EVIL)],
    "changed": [{"name": EVIL, "old": EVIL, "new": 1}], "unsaved": [EVIL], "saved": [EVIL], "file": EVIL,
    "after_restart": [], "words": EVIL, "written_mb": 1.0, "black_box": EVIL, "on": False, "folder": EVIL,
    "files": [
        {"name": EVIL, "size_bytes": 1, "black_box": False, "reason": EVIL, "state": EVIL, "duration_s": 1.0}
    ],
    "deleted": [EVIL], "refused": {EVIL: EVIL}, "patches": [], "remembered": EVIL,
}  # fmt: skip
ODD = [
    {},
    dict.fromkeys(TEXTS, 3),
    {name: [None] for name in TEXTS},
    {name: [{field: {} for field in ("name", "value", "range", "size_bytes")}] for name in TEXTS},
]
QUESTIONS = [
    *(f"{topics.PARAM}/{what}" for what in ("list", "get", "set", "save", "configure", "history", "restart")),
    *(f"{topics.OWN_PARTS}/{what}" for what in ("show", "forget")),
    requests.RECORD, requests.LIST, requests.GET, requests.TRIM,
]  # fmt: skip
COMMANDS = [
    "status", "param list", "param get wall_follow.kp", "param set wall_follow.kp=1", "param save", "param history",
    "own-parts show", "record status", "logs list", "logs get", "logs trim --keep-mb 1", "topic echo status --count 1",
]  # fmt: skip
STATUS = {"car": EVIL, "gates": {"lidar": EVIL}, "output": None, "voices": {}, "battery": None, "fault": EVIL}


class HostileCar(CarSession):
    """Answers everything with one object; announces names that are none."""

    answer, status = {}, STATUS

    def serve(self):
        for question in QUESTIONS:
            self.bus.answer(topics.key("car1", question), lambda _: json.dumps(self.answer).encode())
        for name in ("**", "*", "Car\x1b[2J"):
            self.bus.announce(topics.key(name, topics.ALIVE))
        for name in ("car1/more", "**", "*"):
            self.bus.announce(topics.key(name, f"{topics.REFUSED}/0\x1b[2J"))
        self._speaking = asyncio.create_task(self._speak())

    async def __aexit__(self, *_):
        self._speaking.cancel()
        await asyncio.gather(self._speaking, return_exceptions=True)
        await super().__aexit__()

    async def _speak(self):
        while True:
            with contextlib.suppress(ConnectionError):
                self.bus.put(topics.key("car1", topics.STATUS), json.dumps(self.status).encode())
            await asyncio.sleep(0.05)

    async def told(self, command, capsys):
        """Return exit code and text of a command."""
        code = await asyncio.to_thread(main, [*command.split(), "--connect", self.endpoint])
        said = capsys.readouterr()
        return code, said.out + said.err


@pytest.fixture
async def car(monkeypatch):
    monkeypatch.setattr("wallride.clients.connection.SETTLING_S", 0.02)
    async with HostileCar() as car:
        yield car


async def test_no_text_of_a_car_reaches_the_terminal_raw(car, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    car.answer = TEXTS
    for command in COMMANDS:
        _, text = await car.told(command, capsys)
        assert all(line.isprintable() for line in text.split("\n")), (command, text)
        assert not any(line.startswith("12:00:00") for line in text.split("\n")), (command, text)
        assert "did not expect" not in text, (command, text)


@pytest.mark.parametrize("odd", ODD)
async def test_what_cannot_be_read_is_a_sentence_that_names_the_car(odd, car, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    car.answer = car.status = odd
    for command in COMMANDS[:-1]:
        code, text = await car.told(command, capsys)
        assert "Traceback" not in text
        assert "did not expect" not in text, (command, text)
        assert code == 0 or "car1" in text or len(text.splitlines()) == 1, (command, text)


async def test_names_with_wildcards_are_no_cars(car, capsys, monkeypatch):
    monkeypatch.setattr("wallride.clients.fleet.stop.GIVE_UP_S", 0.5)
    _, text = await car.told("cars", capsys)
    assert [line.split()[0] for line in text.splitlines()] == ["car1"]
    code, text = await car.told("stop --all", capsys)
    assert code == 1
    assert [line.split()[0] for line in text.splitlines()] == ["car1"]
