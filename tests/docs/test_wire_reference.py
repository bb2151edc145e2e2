"""The tables of bytes are those of the code, and a program in another language gets by with them."""

import json
import math
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from wallride.reference.wire import BEAT_FIELDS, COMMAND_FIELDS, REQUESTS, _answers, layout
from wallride.runtime.recording import requests
from wallride.runtime.wire.teleop import Beat, CarCondition, Command, Input, Press, read_command

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "teleop_bytes.mjs"
BEAT = Beat(0xCAFE, 12, CarCondition.PERMITTED, 2**40 + 1, 5, 60, 1.25, "ann")
COMMAND = Command(2**40 + 1, 5, 0xCAFE, 12, Press.MANUAL, Input.SCRIPT, 60, 1.25, -0.25, "ann")


@pytest.mark.parametrize(
    ("message", "fields", "magic"), [(BEAT, BEAT_FIELDS, b"WRB1"), (COMMAND, COMMAND_FIELDS, b"WRC1")]
)
def test_the_tables_read_what_the_code_writes(message, fields, magic):
    numbers = struct.unpack(layout(fields), message.pack())
    read = dict(zip((name for name, _, _ in fields), numbers, strict=True))
    assert read.pop("magic") == magic
    for name, value in read.items():
        said = value.rstrip(b"\0").decode() if isinstance(value, bytes) else value
        assert said == getattr(message, name)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_a_program_in_javascript_answers_a_beat_with_a_command():
    done = subprocess.run(
        ["node", EXAMPLE, "1.5", "-0.25"], input=BEAT.pack(), capture_output=True, check=True, timeout=60
    )
    command = read_command(done.stdout)
    assert (command.car_session, command.beat, command.flags, command.name) == (0xCAFE, 12, Press.MANUAL, "node")
    assert (command.speed_mps, command.steering_rad) == (1.5, -0.25)
    assert math.isclose(command.session, 7)


def test_every_request_has_an_answer_that_a_car_gave_with_nothing_of_this_computer_in_it():
    answers = _answers()
    assert set(answers) == set(REQUESTS)
    for key, answer in answers.items():
        assert "/tmp" not in answer
        if key != requests.GET:
            assert isinstance(json.loads(answer), dict)
    assert json.loads(answers["param/save"])["saved"] == ["wall_follow.kp"]
    assert json.loads(answers["param/configure"])["after_restart"]
    assert json.loads(answers[requests.RECORD])["on"] is False
    assert json.loads(answers[requests.TRIM])["deleted"] == [json.loads(answers[requests.LIST])["files"][0]["name"]]
