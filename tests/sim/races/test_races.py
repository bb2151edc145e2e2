"""`wallride lab races` on one short course, as a user meets it: map, races, table, files, messages."""

import json
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.typed import typed
from wallride.sim.lab.command import LabUsageError
from wallride.sim.races.boxes import surprises_at_s
from wallride.sim.races.command import race_cells, race_choice, run
from wallride.sim.races.mapped_lap import map_course, map_file
from wallride.sim.races.race_cell import RaceCell, Racing, planned_line
from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, StandingObstacle, sudden_box
from wallride.sim.world.pose import Pose

options = partial(typed, "lab", "races")

LAPS = 3


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """Two races on `loop` and their maps' folder: read by the tests, not changed."""
    folder = tmp_path_factory.mktemp("races")
    file = folder / "races.json"
    asked = ["--only", "loop", "--laps", str(LAPS), "--seed", "41", "--jobs", "1", "-o", str(folder / "maps")]
    assert run(options(*asked, "--json", str(file))) == 0
    return folder / "maps", json.loads(file.read_text())


def test_the_line_is_driven_close_to_its_theory_and_faster_than_the_wall(raced):
    ball, line = raced[1]["cells"]
    assert (ball["law"], line["law"]) == ("ball+swept", "line+swept")
    assert ball["laps_driven"] == line["laps_driven"] == LAPS
    assert not ball["collided"]
    assert not line["collided"]
    assert line["lap_s"] < 0.75 * ball["lap_s"]
    assert 0.95 * line["theory_s"] < line["lap_s"] < 1.10 * line["theory_s"]
    assert 0.0 < line["rms_m"] < 0.08
    assert line["rms_m"] < line["p99_m"] < 0.20
    assert line["hard_stops"] == len(line["hard_stops_at"]) == 0
    assert line["way_m"] == pytest.approx(28.6, abs=1.0)


def test_the_file_names_the_conditions(raced):
    summary = raced[1]
    assert (summary["experiment"], summary["speeds_mps"], summary["mu"]) == ("races", [6.0], [0.8])
    assert {(cell["seed"], cell["assumed"], cell["laps"]) for cell in summary["cells"]} == {(41, 1.0, LAPS)}


def test_a_map_that_is_kept_is_taken_again(raced):
    folder = raced[0]
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert map_course("loop", folder) == ""
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert [cell["map_refused"] for cell in raced[1]["cells"]] == ["", ""]
    assert set(before) == {"loop.yaml", "loop.pgm", "loop.path.csv", "loop.walls.csv", "loop.truth.npz"}


@pytest.mark.parametrize(
    ("law", "told"), [("corridor", "assumed_mu"), ("line", "floor_mu"), ("ball", None)]
)  # fmt: skip
def test_the_laws_that_plan_their_speeds_are_told_the_floor(raced, monkeypatch, law, told):
    class BegunError(Exception):
        pass

    def drive_case(cell, case):
        raise BegunError(*cell.settings)

    monkeypatch.setattr("wallride.sim.races.race_cell.laws.drive_case", drive_case)
    with pytest.raises(BegunError) as begun:
        Racing(raced[0])(RaceCell("races", "loop", f"{law}+swept", 6.0, 0.5, "left", 0, assumed=1.2))
    frictions = [text for text in begun.value.args if "mu=" in text]
    assert frictions == ([f"wall_follow.{told}=0.6"] if told else [])


def test_more_assumed_friction_plans_a_faster_line(raced):
    file = map_file("loop", raced[0])
    laps_s = [
        planned_line(RaceCell("races", "loop", "line+swept", 6.0, 0.8, "left", 0, assumed=assumed), file).lap_s
        for assumed in (0.8, 1.2)
    ]
    assert laps_s[0] > 1.05 * laps_s[1]


def test_a_course_without_a_way_round_is_a_row_with_the_reason(tmp_path):
    assert "does not close on itself" in map_course("straight", tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_map_on_which_no_pose_is_found_is_a_row_with_the_reason(raced, tmp_path):
    """As of a lap whose map was refused: the other courses are raced."""
    for file in raced[0].iterdir():
        text = file.read_bytes()
        if file.suffix == ".csv" and ".walls" in file.name:
            text = text.replace(b"\n-", b"\n9")
        (tmp_path / file.name).write_bytes(text)
    row = Racing(tmp_path)(RaceCell("races", "loop", "line+swept", 6.0, 0.8, "left", 0))
    assert "these are not the walls of the image" in row["reason"]
    assert not row["collided"]


def test_every_course_is_raced_by_every_law_on_every_floor(tmp_path):
    asked = options("--method", "ball,line+none", "--mu", ".5,.8", "--tracks", "3", "--seeds", "2", "--only", "track*")
    cells = [cell for cell in race_cells(race_choice(asked), asked) if cell.scenario == "track:seed=3"]
    assert {(cell.law, cell.mu, cell.seed) for cell in cells} == {
        (law, mu, seed) for law in ("ball+swept", "line+none") for mu in (0.5, 0.8) for seed in (7000, 7001)
    }
    default = race_cells(race_choice(options()), options())
    assert {"loop", "loop_inner", "track:seed=7", "track:seed=23"} <= {cell.scenario for cell in default}
    assert {(cell.mu, cell.speed_mps, cell.laps) for cell in default} == {(0.8, 6.0, 5)}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "map.file=my.yaml"], "every race has the map of its own course"),
        (["--method", "magic"], "no law is called"),
        (["--mu", "0"], "numbers between 0.1 and 2"),
        (["--method", "line", "--set", "wall_follow.kpp=1"], "kpp is not a setting"),
    ],
)
def test_wrong_options_say_what_to_write(arguments, words):
    with pytest.raises(LabUsageError, match=words):
        race_choice(options(*arguments))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "nowhere"], "no course is called so; write some of"),
        (["--only", "loop", "-o", "FILE"], "is a file; name a folder"),
        (["--only", "loop", "-o", "FILE/maps/here"], "there is no folder"),
    ],
)
def test_what_cannot_be_raced_ends_before_anything_drives(tmp_path, capsys, arguments, words):
    (tmp_path / "there").write_text("")
    assert run(options(*(text.replace("FILE", str(tmp_path / "there")) for text in arguments))) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["--tracks", "seven"], ["--laps", "2"], ["--speed", "80"], ["--stiffness", "0"], ["--assumed", "nan"]]
)
def test_numbers_are_checked_where_they_are_written(capsys, arguments):
    with pytest.raises(SystemExit):
        options(*arguments)
    assert arguments[0] in capsys.readouterr().err


@pytest.mark.parametrize(
    ("box", "appeared", "surprise_s"),
    [
        (Obstacle(Box(0.3, 0.3), StandingObstacle(Pose(0.0, 0.0, 0.0))), [1, 1, 1], None),
        (Obstacle(Box(0.3, 0.3), StandingObstacle(Pose(0.0, 0.0, 0.0)), ConstantMotion(1.0, 0.0, 0.7)), [1, 1, 1], 0.7),
        (sudden_box(0.5, width_m=0.3), [0, 1, 1], 0.5),
        (sudden_box(0.5, width_m=0.3), [0, 0, 0], None),
    ],
    ids=["stands", "moves", "appears", "never appears"],
)
def test_a_box_surprises_when_it_appears_or_begins_to_move(box, appeared, surprise_s):
    run: Any = SimpleNamespace(appeared=np.array(appeared), time_s=np.array([0.0, 0.5, 1.0]))
    case: Any = SimpleNamespace(obstacles=(box,))
    assert surprises_at_s(run, case) == surprise_s
