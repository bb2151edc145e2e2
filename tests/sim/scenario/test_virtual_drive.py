"""Scenarios in virtual time: the examples hold, and what does not hold is told."""

import asyncio
import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from tests.sim.scenario.test_scenario_file import EXAMPLES
from tests.typed import typed
from wallride.runtime.control.recovery.way_out import HELP
from wallride.sim.lab.sweep.drive_cell import CellMistakeError, DriveCell, measure, setup_of
from wallride.sim.races.mapped_lap import map_course, map_file
from wallride.sim.races.race_cell import RaceCell, planned_line
from wallride.sim.racing.line_file import text_of
from wallride.sim.scenario.command import run
from wallride.sim.scenario.driven import DrivenScenario, judge
from wallride.sim.scenario.scenario_file import load_scenario
from wallride.sim.scenario.toml_lines import FileMistakeError
from wallride.sim.scenario.virtual_drive import Stage, drive_scenario
from wallride.sim.virtual.twin_world import TwinWorld
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.pose import Pose

options = partial(typed, "lab", "scenario")

HEAD = 'world = "corridor"\nduration_s = 4.0\n[settings]\nwall_follow.speed_mps = 2.0\n'


@pytest.fixture
def file_of(tmp_path):
    def write(text):
        (tmp_path / "some.toml").write_text(text)
        return tmp_path / "some.toml"

    return write


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_the_examples_hold(file, capsys):
    assert run(options(file, "--json", "-")) == 0
    (result,) = json.loads(capsys.readouterr().out)
    assert result["passed"]
    assert len(result["expectations"]) >= 3
    lines = file.read_text().splitlines()
    assert all(lines[one["line"] - 1] == "[[expect]]" for one in result["expectations"])


BOXED_IN = """
world = "straight"
[settings]
operator.permit = "required"
recording.enabled = false
process.state_folder = ""
[[obstacle]]
kind = "box"
ahead_m = 0.7
after_s = 3.0
size_m = [0.3, 1.0]
"""


def test_a_permit_let_go_while_the_car_is_boxed_in_ends_no_way_out(file_of):
    scenario = load_scenario(file_of(BOXED_IN))

    async def driven():
        loop = asyncio.get_running_loop()
        twin = TwinWorld(scenario.world, loop.time, start=scenario.start, obstacles=scenario.obstacles)
        stage = Stage(scenario.settings, twin)
        permit = stage.car.permit
        permit.grant(until_s=3.6)
        loop.call_at(9.0, lambda: permit.grant(until_s=20.0))
        return await stage.play(14.0)

    reasons = run_virtual(driven()).reasons
    assert HELP not in reasons
    assert "turning out, try 1 of 6" in reasons


def test_the_same_scenario_gives_the_same_drive(file_of):
    scenario = load_scenario(file_of(HEAD))
    first, second = drive_scenario(scenario), drive_scenario(scenario)
    assert first.pose == second.pose
    assert len(first.time_s) == pytest.approx(160, abs=2)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("kind = 'motor lost'\nafter_s = 2\n", "stands_within_s = 1.5\nafter_s = 2\n"),
        ("kind = 'lidar covered'\nafter_s = 2\n", "stands_within_s = 0.8\nafter_s = 2\n"),
        ("kind = 'lidar covered'\nafter_s = 2\nuntil_s = 2.6\n", "drives_within_s = 1.0\nafter_s = 2.7\n"),
        ("kind = 'slippery floor'\nafter_s = 2\ngrip_mu = 0.2\n", "contact = false\n"),
        ("kind = 'noisy lidar'\nafter_s = 2\nuntil_s = 3\n", "contact = false\n"),
    ],
)
def test_faults_happen(file_of, fault, expected):
    without, with_it = HEAD + f"[[expect]]\n{expected}", HEAD + f"[[expect]]\n{expected}[[fault]]\n{fault}"
    scenario = load_scenario(file_of(with_it))
    disturbed = drive_scenario(scenario)
    (judged,) = judge(scenario, disturbed)
    assert judged.holds, judged.words
    assert drive_scenario(load_scenario(file_of(without))).pose != disturbed.pose


def test_what_does_not_hold_is_told_with_its_line_and_exit_code_1(file_of, capsys):
    file = file_of(HEAD + "[[expect]]\nspeed_below_mps = 1.0\n[[expect]]\ncontact = false\n")
    assert run(options(file)) == 1
    said = capsys.readouterr().out
    assert "FAIL some.toml:5: speed_below_mps = 1: at most 2.0" in said
    assert "pass some.toml:7: contact = false: touched nothing" in said


def test_a_law_that_fails_is_told_with_exit_code_1_whatever_holds(file_of, capsys):
    """Nothing is touched by a car that stands because its law has failed."""
    file = file_of(HEAD + "wall_follow.method = 'failing:Follower'\n[[expect]]\ncontact = false\n")
    (file.parent / "failing.py").write_text(
        "from wallride.laws import Guidance\n\n\nclass Follower:\n    def __init__(self, settings, car):\n"
        "        self.left = 9\n\n    def follow(self, scan, state):\n"
        "        self.left -= 1\n        return Guidance(1.0 / max(self.left, 0), 0.0)\n"
    )
    assert run(options(file)) == 1
    said = capsys.readouterr().out
    assert "pass some.toml:6: contact = false: touched nothing" in said
    assert "FAIL some.toml: failing:Follower raised ZeroDivisionError: float division by zero (" in said
    assert "failing.py:10)" in said


def test_a_file_without_expectations_says_so(file_of, capsys):
    assert run(options(file_of(HEAD))) == 0
    assert "no [[expect]] in it" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        ("kind = 'box'\nat = [40, 0]\n", "this box was never nearer than 3"),
        ("kind = 'box'\nahead_m = 1\ncar_speed_mps = 3\n", "this box never appeared"),
    ],
)
def test_an_obstacle_that_is_never_reached_is_a_mistake_of_its_line(file_of, capsys, obstacle, words):
    file = file_of(HEAD + f"\n[[obstacle]]\n{obstacle}[[expect]]\ncontact = false\n")
    assert run(options(file)) == 2
    said = capsys.readouterr().err
    assert f"{file}:6: obstacle never reached" in said
    assert words in said


def test_a_mistake_in_a_file_is_exit_code_2(file_of, capsys):
    assert run(options(file_of(HEAD + "[[wall]]\npoints = [[1, 3], [1, 3]]\n"))) == 2
    assert "some.toml:5: wall: the wall from 1, 3 to 1, 3 has no length" in capsys.readouterr().err


def driven(**lists):
    count = len(lists["time_s"])
    made = {
        "pose": [Pose(float(index), 0.0, 0.0) for index in range(count)],
        "speed_mps": [1.0] * count,
        "wall_m": [1.0] * count,
        "clearance_m": [0.5] * count,
        "reasons": ["wall"] * count,
    }
    return DrivenScenario(**{**made, **lists})


@pytest.mark.parametrize(
    ("expected", "record", "holds"),
    [
        ("contact = true", {"contact_mps": 0.5}, True),
        ("contact = false", {"contact_mps": 0.5}, False),
        ("stands = true", {"speed_mps": [0.0, 0.04, 0.0]}, True),
        ("stands = true", {"speed_mps": [0.0, 0.06, 0.0]}, False),
        ("stands = false", {"speed_mps": [0.0, 0.06, 0.0]}, True),
        ("stands_within_s = 0.4\nafter_s = 0.5", {"speed_mps": [0.0, 1.0, 0.0]}, False),
        ("stands_within_s = 0.5\nafter_s = 0.5", {"speed_mps": [0.0, 1.0, 0.0]}, True),
        ("drives_within_s = 0.6", {"speed_mps": [0.0, 0.3, 0.0]}, True),
        ("drives_within_s = 0.6\nuntil_s = 0.4", {"speed_mps": [0.0, 0.3, 0.0]}, False),
        ("mean_error_below_m = 0.11", {"wall_m": [0.8, 1.1, 1.0]}, True),
        ("mean_error_below_m = 0.1", {"wall_m": [0.8, 1.1, 1.0]}, False),
        ("max_error_below_m = 0.21", {"wall_m": [0.8, 1.1, float("inf")]}, True),
        ("max_error_below_m = 0.19", {"wall_m": [0.8, 1.1, 1.0]}, False),
        ("max_error_below_m = 0.19", {"wall_m": [float("inf")] * 3}, False),
        ("clearance_above_m = 0.2", {"clearance_m": [0.5, 0.2, 0.5]}, False),
        ("speed_below_mps = 1.5\nafter_s = 1", {"speed_mps": [2.0, 2.0, 1.0]}, True),
        ("mean_speed_above_mps = 1.6", {"speed_mps": [2.0, 2.0, 1.0]}, True),
        ("way_above_m = 2", {"speed_mps": [1.0] * 3}, False),
        ("way_above_m = 2", {"speed_mps": [1.0] * 4}, True),
        ("laps_at_least = 2", {"laps_s": [9.0, 8.0]}, True),
        ("lap_below_s = 8", {"laps_s": [9.0, 8.0]}, False),
        ("lap_below_s = 8", {"laps_s": []}, False),
        ("reason = 'wall'", {"reasons": ["", "wall ahead", ""]}, True),
        ("reason = 'braking'", {"reasons": ["", "wall ahead", ""]}, False),
        ("reason = 'braking'", {"reasons": []}, None),
        ("stands = true\nafter_s = 3", {"speed_mps": [0.0] * 3}, False),
    ],
)  # fmt: skip
def test_each_condition_is_judged(file_of, expected, record, holds):
    head = HEAD.replace("corridor", "loop") if "lap" in expected else HEAD
    scenario = load_scenario(file_of(head + f"[[expect]]\n{expected}\n"))
    (judged,) = judge(
        scenario, driven(**{"time_s": [0.5 * i for i in range(len(record.get("speed_mps", [1] * 3)))], **record})
    )
    assert judged.holds is holds
    assert judged.line == 5


def test_a_law_beside_the_file_is_found(tmp_path):
    (tmp_path / "beside_law.py").write_text(
        "from wallride.laws import Guidance\n\n\nclass Law:\n    def __init__(self, settings, car):\n        pass\n\n"
        "    def follow(self, scan, state):\n        return Guidance(1.0, 0.0)\n"
    )
    file = tmp_path / "some.toml"
    file.write_text(HEAD + "wall_follow.method = 'beside_law:Law'\n[[expect]]\nmean_speed_above_mps = 0.5\n")
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-m", "wallride", "lab", "scenario", str(file)], cwd=root, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr + done.stdout


def test_a_scenario_races_on_the_map_that_it_names(file_of, tmp_path):
    assert not map_course("loop", tmp_path)
    file = map_file("loop", tmp_path)
    cell = RaceCell("races", "loop", "line+swept", 4.0, 0.8, "left", 1)
    file.with_name("loop.line.csv").write_text(text_of(planned_line(cell, file), "loop"))
    text = 'world = "loop"\nduration_s = 4.0\n[settings]\nwall_follow.method = "line"\n'
    scenario = load_scenario(file_of(f'{text}map.file = "{file}"\n'))
    assert "race line" in drive_scenario(scenario).reasons
    assert load_scenario(file_of(f'{text}map.file = "loop.yaml"\n')).settings.map.file == str(file)
    with pytest.raises(FileMistakeError, match=r"some.toml:.*map.file names none"):
        load_scenario(file_of(text))
    with pytest.raises(FileMistakeError, match=r"some.toml:5: .*none.yaml"):
        load_scenario(file_of(f'{text}map.file = "{tmp_path}/none.yaml"\n'))
    cells = [
        DriveCell.of({"law": "line", "world": "loop", "duration_s": 4.0, "map.file": str(name)})
        for name in (file, tmp_path / "none.yaml")
    ]
    assert measure(cells[0])["last_reason"] == "race line"
    with pytest.raises(CellMistakeError, match=r"none.yaml"):
        setup_of(cells[1])


def test_only_a_scenario_with_code_of_the_users_names_its_folder(file_of):
    assert not any("laws_folder" in one for one in load_scenario(file_of(HEAD)).assignments)
