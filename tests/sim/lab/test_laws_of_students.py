"""Laws of several students, graded by one command: each is its own, and one that fails is a failure."""

import json
import subprocess
import sys

import pytest

LAW = """
import os
from wallride.laws import Guidance

class Follower:
    def __init__(self, settings, car):
        self.scans = 0

    def follow(self, scan, state):
        self.scans += 1
        if self.scans > 40:
            {at_40}
        return Guidance({speed_mps}, 0.0)
"""
SCENARIO = """
world = "corridor"
duration_s = 3
[settings.wall_follow]
method = "my_laws:Follower"
[[expect]]
after_s = 2
speed_below_mps = 0.5
"""
WALLS = "--only", "t1", "--speeds", "1", "--mu", "0.8", "--side", "left"
TUNE = "--param", "safety.grip_mu=0.7:0.8", "--trials", "1", "--only", "t1", "-o", "tn"


@pytest.fixture
def folder(tmp_path):
    def write(name, at_40="pass", speed_mps=1.0):
        place = tmp_path / name
        place.mkdir()
        (place / "my_laws.py").write_text(LAW.format(at_40=at_40, speed_mps=speed_mps))
        (place / "t.toml").write_text(SCENARIO)
        return place

    return write


def lab(place, *words):
    command = [sys.executable, "-m", "wallride", "lab", *map(str, words)]
    return subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=200, check=False)


def test_the_law_beside_a_scenario_is_the_one_that_is_driven(folder, tmp_path):
    slow, fast = folder("slow", speed_mps=0.3), folder("fast")
    assert lab(tmp_path, "scenario", "slow/t.toml").returncode == 0
    assert lab(tmp_path, "scenario", "fast/t.toml").returncode == 1
    both = lab(tmp_path, "scenario", slow / "t.toml", fast / "t.toml")
    assert (both.returncode, "is imported already" in both.stderr) == (2, True), both.stderr
    of_both = lab(slow, "scenario", fast / "t.toml")
    assert (of_both.returncode, "move or rename one" in of_both.stderr) == (2, True), of_both.stderr


@pytest.mark.parametrize(
    ("at_40", "words", "says"),
    [
        ("os._exit(0)", ("walls", "--method", "my_laws:Follower", *WALLS), "ended with exit code 0"),
        ("raise ValueError('no')", ("walls", "--method", "my_laws:Follower", *WALLS), "raised ValueError"),
        ("raise KeyboardInterrupt", ("walls", "--method", "my_laws:Follower", *WALLS), "raised KeyboardInterrupt"),
        ("raise ValueError('no')", ("tune", "--method", "my_laws:Follower", *TUNE), "raised ValueError"),
    ],
    ids=["it ends the process", "it raises", "it raises a Ctrl-C", "it raises while it is tuned"],
)
def test_a_law_that_fails_ends_with_its_sentence_and_code_1(folder, at_40, words, says):
    done = lab(folder("one", at_40), *words)
    assert (done.returncode, says in done.stderr) == (1, True), done.stderr


def test_what_a_law_prints_is_no_part_of_the_answer(folder):
    place = folder("one", at_40="print('here')", speed_mps=0.3)
    for words in (("scenario", "t.toml"), ("walls", "--method", "my_laws:Follower", *WALLS)):
        done = lab(place, *words, "--json", "-")
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)
        assert "here" in done.stderr


def test_a_mistake_in_a_later_scenario_is_told_before_the_first_is_driven(folder, tmp_path):
    folder("one", speed_mps=0.3)
    (tmp_path / "bad.toml").write_text("world = 3")
    done = lab(tmp_path, "scenario", "one/t.toml", "bad.toml")
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
