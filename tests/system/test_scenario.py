"""`wallride sim SCENARIO`: a scenario's file in real time, through the real drivers, with a pulled cable."""

import json
import os
import subprocess
import sys

import pytest

from wallride.cli import main

SCENARIO = """world = "loop"
duration_s = 6.0
[settings]
wall_follow.speed_mps = 1.5
[[fault]]
kind = "{kind}"
after_s = 3.0
[[expect]]
drives_within_s = 3.0
[[expect]]
stands_within_s = 2.0
after_s = 3.0
[[expect]]
way_above_m = {way_m}
"""


def played(folder, text, *options):
    (folder / "some.toml").write_text(text)
    return subprocess.run(
        [sys.executable, "-m", "wallride", "sim", str(folder / "some.toml"), "--headless", *options],
        capture_output=True, text=True, timeout=55, check=False, env={**os.environ, "TERM": "dumb", "COLUMNS": "200"},
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["lidar lost", "motor lost"])
def test_a_fault_happens_on_the_emulated_devices_and_the_expectations_hold(tmp_path, kind):
    done = played(tmp_path, SCENARIO.format(kind=kind, way_m=1), "--json", str(tmp_path / "summary.json"))
    assert done.returncode == 0, done.stderr
    assert "pass some.toml:10: stands_within_s = 2 after 3 s: stood after" in done.stdout, "results are no log"
    assert "it stands because" in done.stdout
    assert "it stands because" not in done.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["stopped"]
    assert summary["duration_s"] == pytest.approx(6.0, abs=2.0)


def test_what_does_not_hold_is_exit_code_1(tmp_path):
    done = played(tmp_path, SCENARIO.format(kind="lidar lost", way_m=100))
    assert done.returncode == 1
    assert "FAIL some.toml:13: way_above_m = 100: " in done.stdout


@pytest.mark.parametrize(
    ("more", "options", "words"),
    [
        ("[[obstacle]]\nkind = 'box'\n", [], "some.toml:15: obstacle: say where it is"),
        ("", ["--friction", "0.5"], "says where and in what conditions the car drives; change it there"),
        ("", ["--pose", "0,3,0"], "says where and in what conditions the car drives; change it there"),
    ],
)
def test_mistakes_end_it_before_the_car_starts(tmp_path, capsys, more, options, words):
    (tmp_path / "some.toml").write_text(SCENARIO.format(kind="lidar lost", way_m=1) + more)
    assert main(["sim", str(tmp_path / "some.toml"), "--headless", *options]) == 2
    assert words in capsys.readouterr().err
