"""`wallride lab` as a user meets it: cells, files, messages."""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest
from PIL import Image

from tests.promises import promise
from tests.typed import typed
from wallride.sim.lab import hazards, laps, safety, walls
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.lab.command import LabUsageError, chosen, only, run
from wallride.sim.lab.courses.sudden import BOXES, PLACES
from wallride.sim.lab.courses.walls import ALL_COURSES
from wallride.sim.lab.laws import GUARD_OF, build, check

options = partial(typed, "lab")


def test_walls_json_has_every_cell(tmp_path, capsys):
    file = tmp_path / "walls.json"
    asked = ["--quick", "--method", "report", "--speeds", "4", "--mu", ".8,.5", "--side", "left,right", "--seeds", "1"]
    assert run(options("walls", *asked, "--jobs", "1", "--json", str(file))) == 0
    summary = json.loads(file.read_text())
    names = [
        tuple(cell[name] for name in ("scenario", "law", "speed_mps", "mu", "side", "seed"))
        for cell in summary["cells"]
    ]
    wanted = itertools.product(walls.QUICK_COURSES, ["report+report"], [4.0], [0.8, 0.5], ["left", "right"], [1000])
    assert sorted(names) == sorted(wanted)
    figures = {"mean_error_m", "rms_error_m", "settle_s", "overshoot_m", "collided", "limit_m", "safety_stops"}
    assert all(figures <= set(cell) for cell in summary["cells"])
    said = capsys.readouterr().out
    assert "mean |error| / best found [m]" in said
    assert said.count("a cell: mean |error| /") == said.count("settle s: until the error stays") == 1
    assert not any(words in said for words in ("design notes", "(decision", "references"))


def test_courses_are_chosen_by_name_and_by_pattern(tmp_path):
    file = tmp_path / "walls.json"
    asked = ["--only", "t2,t[13] rough", "--speeds", "4", "--mu", ".8", "--side", "left", "--method", "report"]
    assert run(options("walls", *asked, "--jobs", "1", "--json", str(file))) == 0
    assert {cell["scenario"] for cell in json.loads(file.read_text())["cells"]} == {"t2", "t1 rough", "t3 rough"}


def test_a_course_that_does_not_exist_is_answered_with_those_that_do(capsys):
    assert run(options("walls", "--only", "t1,t9")) == 2
    assert "--only t9" in (said := capsys.readouterr().err)
    assert "t1, t2, t3" in said


def test_quick_is_quick_on_all_cores(tmp_path):
    began_s = time.monotonic()
    assert run(options("walls", "--quick", "--method", "report", "--json", str(tmp_path / "quick.json"))) == 0
    took_s = time.monotonic() - began_s
    assert len(json.loads((tmp_path / "quick.json").read_text())["cells"]) == 10
    promise("lab walls --quick", took_s, 20.0)


def test_json_to_standard_output_is_all_there_is(capsys):
    asked = ["--method", "report", "--speeds", "1", "--mu", "1", "--side", "left", "--jobs", "1"]
    assert run(options("safety", *asked, "--only", "?.? m", "--json", "-")) == 0
    assert len(json.loads(capsys.readouterr().out)["cells"]) == 7


def test_pictures_are_drawn(tmp_path):
    asked = ["--method", "report", "--speeds", "4", "--mu", "1", "--side", "left", "--jobs", "1", "--quick"]
    assert run(options("laps", *asked, "--plot", str(tmp_path / "new"))) == 0
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["laps-loop-report+report-4-1-left-1000.png"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--method", "magic"], "write one of ball, "),
        (["--speeds", "1,fast"], "numbers between 0.3 and 8"),
        (["--speeds", "nan"], "numbers between 0.3 and 8"),
        (["--mu", "0"], "numbers between 0.1 and 2"),
        (["--side", "up"], "left, right or left,right"),
        (["--seeds", "0"], "at least one"),
        (["--distance", "0.1"], "numbers between 0.3 and 3"),
        (["--distance", "0.5,1"], "write one number"),
    ],
)
def test_wrong_options_say_what_to_write(arguments, words):
    with pytest.raises(LabUsageError, match=words):
        chosen(options("walls", *arguments))


def test_another_distance_is_asked_for_started_at_and_counted_against():
    cells = walls.cells(chosen(options("walls", "--distance", "0.6", "--quick")))
    (curved,) = (one for one in cells if one.scenario == "outside_corner" and one.speed_mps == 1.0)
    figures = walls.measure(curved)
    assert figures["mean_error_m"] < 0.1
    assert {one.desired_m for one in cells} == {0.6}


def test_the_full_plan_holds_what_the_issue_names():
    full = chosen(options("walls", "--method", "report"))
    assert len(walls.cells(full)) == len(ALL_COURSES) * 4 * 3 * 2
    blind, driven = 28, 28 * 2 * len(PLACES) * len(BOXES)
    assert len(safety.cells(full)) == (blind + driven) * 3 * 2
    kinds = [cell.scenario.startswith(hazards.NORMAL) for cell in hazards.cells(full)]
    assert kinds.count(False) >= 12 * 4 * 3 * 2
    assert kinds.count(True) >= 80


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("image: gone.png\nresolution: 0.05\norigin: [0, 0, 0]\n", "the map's image"),
        ("resolution: 0.05\n", "not a map file"),
        ("image: m.yaml\nresolution: 0.05\norigin: [0, 0, 0]\n", "not an image that can be read"),
    ],
)
def test_a_map_that_cannot_be_read_is_one_sentence_before_anything_drives(tmp_path, capsys, content, words):
    (tmp_path / "m.yaml").write_text(content)
    assert run(options("laps", "--maps", str(tmp_path), "--jobs", "1")) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert "Traceback" not in said


def test_what_drives_on_maps_finds_them(tmp_path):
    Image.new("L", (40, 40), 254).save(tmp_path / "hall.png")
    (file := tmp_path / "hall.yaml").write_text(
        "image: hall.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    assert chosen(options("laps", "--maps", str(tmp_path))).maps == (str(file),)


def test_other_experiments_take_no_maps():
    assert chosen(options("walls")).maps == ()


@pytest.mark.parametrize("law", [*GUARD_OF, "report+none", "ball+report"])
def test_every_law_can_be_built(law):
    follower, guard = build(law, "right", 0.8, 2.0)
    assert callable(follower.follow)
    assert (guard is None) == law.endswith("none")
    assert check(law).count("+") == 1


def cell(experiment, scenario, law="report", speed_mps=1.0, mu=0.8):
    return Cell(experiment, scenario, check(law), speed_mps, mu, "left", 0)


def test_safety_tells_stoppable_from_not():
    easy = safety.measure(cell("safety", "0.9 m"))
    hopeless = safety.measure(cell("safety", "0.3 m", speed_mps=4.0))
    assert easy["stoppable"]
    assert easy["stopped"]
    assert not hopeless["stoppable"]
    assert not hopeless["stopped"]
    assert hopeless["impact_mps"] == pytest.approx(hopeless["expected_impact_mps"], abs=0.2)
    assert hopeless["brake_latency_ms"] == pytest.approx(20.0)


@pytest.mark.parametrize("driver", ["follower", "human"])
@pytest.mark.parametrize("mu", [0.5, 0.8])
def test_a_driver_who_swerves_before_a_box_is_stopped_as_a_blind_one(driver, mu):
    """Both turned with a brake of 0.8 g to 0.4 g where only the whole grip stops the car: hit at 2 m/s and more."""
    for scenario, speed_mps in (("corridor 0.8-centred 0.9m", 3.0), ("wall 0.3-left 0.5m", 2.0)):
        figures = safety.measure(cell("safety", f"{driver} {scenario}", "ball", speed_mps, mu))
        assert figures["clear"] or figures["excess_mps"] <= safety.EXCESS_MPS
        assert figures["clear"] or not figures["stoppable"]


def test_a_driver_who_swerves_without_safety_hits():
    for driver in ("follower", "human"):
        assert not safety.measure(cell("safety", f"{driver} corridor full-width 0.9m", "ball+none", 3.0))["clear"]


def test_safety_counts_commands_to_move_under_a_guard_that_does_not_look():
    assert safety.measure(cell("safety", "0.5 m", "report+none", 2.0))["moving_commands"] > 0
    assert safety.measure(cell("safety", "0.5 m", "ball", 2.0))["moving_commands"] == 0


@pytest.mark.parametrize("scenario", list(hazards.HAZARDS))
def test_every_hazard_is_hit_by_who_does_not_look(scenario):
    assert hazards.measure(cell("hazards", scenario, "report+none", 2.0))["collided"]


def test_a_lap_is_timed():
    done = laps.measure(cell("laps", "loop", "ball", 2.0))
    assert done["laps"] == laps.LAPS
    assert 10.0 < done["best_lap_s"] < 20.0
    assert done["lap_times_s"][0] > done["best_lap_s"]


def test_cells_go_slowest_first():
    choice = CellChoice(("report+report",), (4.0, 1.0), (0.8,), ("left",), (0,))
    speeds = [cell.speed_mps for cell in choice.cells("walls", ["t1", "t2"])]
    assert speeds == [1.0, 1.0, 4.0, 4.0]


def test_a_start_that_nobody_could_survive_is_no_normal_drive():
    asked = chosen(options("hazards", "--method", "ball", "--mu", ".8"))
    normal = {(cell.scenario, cell.speed_mps) for cell in hazards.cells(asked)}
    assert ("normal t1", 3.0) in normal
    assert ("normal t1", 4.0) not in normal


def test_ctrl_c_ends_all_processes(tmp_path):
    """A real SIGINT, as a terminal sends it, to a real pool."""
    script = (
        "import argparse, signal, sys\n"
        "from wallride import lab_options\n"
        "from wallride.sim.lab.command import run\n"
        "if __name__ == '__main__':\n"
        "    signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "    parser = argparse.ArgumentParser()\n"
        "    lab_options.add(parser)\n"
        "    print('ready', flush=True)\n"
        "    sys.exit(run(parser.parse_args(['walls', '--method', 'report', '--jobs', '2'])))\n"
    )
    file = tmp_path / "lab.py"
    file.write_text(script)
    root = Path(__file__).resolve().parents[3]
    with subprocess.Popen(
        [sys.executable, str(file)],
        env={**os.environ, "PYTHONPATH": str(root)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        try:
            process.stdout.readline()
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=3.0)  # the full plan takes far longer: it is under way
            os.killpg(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=20)  # returns when the last holder of the pipe is gone: no orphans
        finally:
            with suppress(ProcessLookupError):  # as it is where all have ended
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "interrupted" in said
    assert "Traceback" not in said


def test_a_map_is_chosen_by_its_name_alone():
    cells = [Cell("laps", path, "ball+swept", 1.0, 0.8, "left", 0) for path in ("/far/maps/levine.yaml", "loop")]
    assert only(cells, "levine") == cells[:1]
    assert only(cells, "/far/maps/levine.yaml") == cells[:1]
    with pytest.raises(LabUsageError, match="write some of levine, loop"):
        only(cells, "levin")


def test_the_other_experiments_take_settings_too():
    choice = chosen(options("walls", "--quick", "--method", "report", "--set", "wall_follow.kp=3"))
    cell = next(one for one in walls.cells(choice) if one.scenario == "t3")
    assert cell.settings == ("wall_follow.kp=3",)
    plain = Cell(*(getattr(cell, name) for name in Cell.__dataclass_fields__ if name != "settings"))
    assert walls.measure(cell)["mean_error_m"] != walls.measure(plain)["mean_error_m"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wall_follow.side=right", "--side"),
        ("wall_follow.kpp=1", "kpp is not a setting"),
        ("map.file=no.yaml", "no map file"),
    ],
)
def test_a_setting_that_the_lab_varies_or_does_not_know_is_refused(text, words):
    with pytest.raises(LabUsageError, match=words):
        chosen(options("walls", "--set", text))
