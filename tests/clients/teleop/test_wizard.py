"""An unknown pad is learnt from what a person does with it."""

import signal
import subprocess
import sys

import pytest

from wallride.clients.teleop import pad_files
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pads import Axis, Button, Hat
from wallride.clients.teleop.wizard import Wizard


def answer(wizard, *events):
    for event in events:
        wizard.feed(event, 1.0)


def press(index):
    return Button(index, pressed=True), Button(index, pressed=False)


def test_a_whole_conversation():
    wizard = Wizard("ff", "Mystery pad", (0.0, 0.0, -1.0, 0.0))
    assert "FORWARD" in wizard.question
    answer(wizard, Hat(0, 0, 1), Hat(0, 0, 0))
    assert "MODE" in wizard.remark
    answer(wizard, Axis(2, 0.9), Axis(2, -1.0))
    assert "trigger" in wizard.remark
    answer(wizard, Axis(1, -0.4), Axis(1, -1.0), Axis(1, -0.5), Axis(1, 0.0))
    answer(wizard, Axis(1, -0.4), Axis(1, -1.0), Axis(1, 0.0))
    assert "speed already" in wizard.remark
    answer(wizard, Axis(3, 0.4), Axis(3, 1.0), Axis(3, 0.1))
    answer(wizard, *press(6))
    answer(wizard, *press(6))
    assert "manual already" in wizard.remark
    answer(wizard, *press(7), *press(2))
    answer(wizard, Hat(0, 1, 0), Hat(0, 0, 0))
    assert "takes over" in wizard.question
    answer(wizard, Axis(2, 0.9), Axis(2, -1.0))
    assert wizard.finished
    assert wizard.question == ""
    answer(wizard, *press(1))

    guid, learnt = pad_files.read(wizard.toml(), "test")
    assert guid == "ff"
    controls = ("speed", "steering", "manual", "autonomy", "estop", "reset", "take_over")
    assert " ".join(str(learnt.bindings[Control(name)]) for name in controls) == "a1~ a3 b6 b7 b2 h0.2 +a2"


def test_a_trigger_that_reads_zero_until_touched_cannot_steer():
    wizard = Wizard("ff", "pad", (0.0, 0.0))
    answer(wizard, Axis(1, -1.0), Axis(1, 0.0))
    assert "trigger" in wizard.remark
    assert "FORWARD" in wizard.question


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_wait_for_a_pad_is_ended_by_signals(number):
    command = [sys.executable, "-m", "wallride", "teleop", "--map"]
    nothing, pipe = subprocess.DEVNULL, subprocess.PIPE
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where a shell runs in the background
    with subprocess.Popen(command, stdin=nothing, stdout=pipe, text=True) as waiting:
        try:
            assert waiting.stdout is not None
            assert waiting.stdout.readline().startswith("Plug in the pad")
            waiting.send_signal(number)
            assert waiting.wait(timeout=10) == 130
        finally:
            waiting.kill()
            signal.signal(signal.SIGINT, before)
