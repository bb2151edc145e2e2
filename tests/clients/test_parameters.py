"""The words of `wallride param`, and its questions to a desk over a real session."""

import json

import pytest

from tests.clients.speaking_car import CarSession
from tests.typed import typed
from wallride.clients import parameters
from wallride.clients.connection import ConnectionProblemError
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.server import ParameterServer, ServerContext
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.runtime.tasks.parameters import serve


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("a.b=1", "a.b", 1),
        ("a.b = 0.5", "a.b", 0.5),
        ("a.b=true", "a.b", True),
        ("a.b=right", "a.b", "right"),
        ('a.b="right"', "a.b", "right"),
        ("a.b=tcp/1.2.3.4:5", "a.b", "tcp/1.2.3.4:5"),
        ('a.b=["x", "y"]', "a.b", ["x", "y"]),
        ("a.b=2026-01-01", "a.b", "2026-01-01"),
        ("a.b={c=1}", "a.b", "{c=1}"),
        ("a.b=", "a.b", ""),
    ],
)
def test_values_are_read_as_in_the_file(text, name, value):
    assert parameters.parsed([text]) == {name: value}


def test_bytes_that_are_no_text_are_named_and_not_sent():
    with pytest.raises(ConnectionProblemError, match="is not text in UTF-8"):
        parameters.parsed(["wall_follow.side=\udcff"])


@pytest.mark.parametrize("text", ["a.b", "=1", " = 1", ""])
def test_what_is_no_assignment_is_one_clear_message(text):
    with pytest.raises(ConnectionProblemError, match="write NAME=VALUE"):
        parameters.parsed([text])


class Car(CarSession):
    """A desk on a session of its own, and a client's command line."""

    def __init__(self, tmp_path):
        super().__init__()
        self.file = tmp_path / "car.toml"
        self.file.write_text("[wall_follow]\nkp = 13.5  # gain\n")
        car = ServerContext(lambda *_: None, lambda: False, lambda: 1e9, lambda: "2026-01-01T00:00:00Z", self.file)
        self.desk = ParameterServer(Settings(), car, ChangeHistory(10))

    def serve(self):
        serve(self.bus, "car1", self.desk, RestartDesk(lambda: "", None))


async def param(car, *words):
    return await parameters.run(typed("param", *words, "--connect", car.endpoint))


async def test_a_session_with_a_car(tmp_path, capsys):
    async with Car(tmp_path) as car:
        assert await param(car, "get", "wall_follow.kp") == 0
        assert capsys.readouterr().out == "13.5\n"
        assert await param(car, "set", "wall_follow.kp=0.5", "wall_follow.side=right") == 0
        assert capsys.readouterr().out.splitlines() == [
            "wall_follow.side: left -> right",
            "wall_follow.kp: 13.5 -> 0.5",
            "until the restart; not saved yet: wall_follow.kp, wall_follow.side (wallride param save)",
        ]
        assert await param(car, "set", "wall_follow.kp=0.5") == 0
        assert "nothing changed" in capsys.readouterr().out
        assert await param(car, "list", "wall_follow.k") == 0
        kp, kd = capsys.readouterr().out.splitlines()
        assert kp.split("  ")[:2] == ["wall_follow.kp", "0.5 (default 13.5)"]
        assert "a number from 0 to 20 rad/m" in kp
        assert "Gain of the heading error" in kd
        assert await param(car, "list", "wall_follow.kp", "--json") == 0
        assert json.loads(capsys.readouterr().out)[0]["value"] == 0.5
        assert await param(car, "save", "parameters.history=30") == 0
        assert "after a restart: parameters.history: 100 -> 30" in capsys.readouterr().out
        assert load_settings(car.file).wall_follow.kp == 0.5
        assert await param(car, "save") == 0
        assert "nothing to save" in capsys.readouterr().out
        assert await param(car, "history") == 0
        assert len(capsys.readouterr().out.splitlines()) == 3
        assert await param(car, "get", "wall_follow.kp", "wall_follow.side", "--json") == 0
        assert json.loads(capsys.readouterr().out) == {"wall_follow.kp": 0.5, "wall_follow.side": "right"}


async def test_a_refusal_is_one_line_with_the_range(tmp_path):
    async with Car(tmp_path) as car:
        with pytest.raises(ConnectionProblemError, match=r"^wall_follow.kp = 99: must be a number from 0 to 20 rad/m$"):
            await param(car, "set", "wall_follow.kp=99")
        with pytest.raises(ConnectionProblemError, match="after a restart"):
            await param(car, "set", "motor.address=serial:///dev/other")
        with pytest.raises(ConnectionProblemError, match="is not a setting"):
            await param(car, "get", "wall_follow.kpp")


async def test_a_car_without_a_desk_is_said():
    async with CarSession() as car:
        with pytest.raises(ConnectionProblemError, match="does not answer param/get"):
            await param(car, "get", "wall_follow.kp")
