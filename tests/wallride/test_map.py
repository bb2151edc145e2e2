"""`wallride map` from the command line: a recording of wallride becomes a map that `wallride line` takes as it is."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.full_disk import full_disk
from tests.sim.replay.recorded import record
from wallride import cli
from wallride.sim.mapping.closing import close_lap
from wallride.sim.mapping.command import advice
from wallride.sim.mapping.lap_record import read_record, wheel_words
from wallride.sim.mapping.verdict import judge_map
from wallride.sim.world.map_file import read_geometry

pytestmark = pytest.mark.usefixtures("here")
FOLLOW = {"wall_follow": {"speed_mps": 4.0}}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laps")
    record(folder / "lap.mcap", seconds=16.0, sections=FOLLOW)
    record(folder / "piece.mcap", seconds=4.0, sections=FOLLOW)
    return folder


def test_a_recorded_lap_becomes_a_map_and_the_map_a_line(recordings, here, capsys):
    assert cli.main(["map", str(recordings / "lap.mcap"), "-o", "läb #1: x.yaml"]) == 0
    said = capsys.readouterr().out
    assert "by wheels and steering, without a gyro" in said
    assert said.endswith("verdict: good\n")
    made = {f"läb #1: x.{ending}" for ending in ("path.csv", "pgm", "png", "walls.csv", "yaml")}
    assert {file.name for file in here.iterdir()} == made
    _, area_m2 = read_geometry(here / "läb #1: x.yaml")
    assert area_m2 == pytest.approx(64.0, rel=0.06), "12 x 8 m less 8 x 4 m"
    assert cli.main(["line", "läb #1: x.yaml", "--json", "-"]) == 0
    line = json.loads(capsys.readouterr().out)
    assert cli.main(["line", "loop", "--json", "-"]) == 0
    assert line["lap_s"] == pytest.approx(json.loads(capsys.readouterr().out)["lap_s"], rel=0.03)


def test_a_piece_of_a_lap_is_refused_unless_it_is_meant(recordings, here, capsys):
    piece = str(recordings / "piece.mcap")
    assert cli.main(["map", piece]) == 1
    said = capsys.readouterr().out
    assert "verdict: refused: the ring is open: the drive ends" in said
    assert said.splitlines()[-1] == "drive the lap again; docs/racing.md says what each reason asks for"
    assert (here / "piece.png").stat().st_size > 10_000
    (here / "lab.yaml").write_text("# map by wallride of lap.mcap, good\n")
    assert cli.main(["map", piece, "-o", "lab.yaml"]) == 1
    assert "written: lab-refused.yaml" in capsys.readouterr().out, "a good map stays"
    assert (here / "lab.yaml").read_text().endswith("good\n")
    assert cli.main(["map", piece, "--open", "--json", "-"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["reasons"], figures["map"]) == ([], "piece.yaml")
    assert figures["residual_m"] < 0.01
    rows = np.loadtxt(here / "piece.path.csv", delimiter=";")
    assert np.hypot(*np.diff(rows[:, 1:3], axis=0).T).sum() == pytest.approx(figures["way_m"], rel=0.02)


@pytest.mark.parametrize("name", ["lab.yaml", "lab.pgm", "lab.png"])
def test_a_map_of_another_program_is_not_replaced(name, recordings, here, capsys):
    piece = ["map", str(recordings / "piece.mcap"), "--open", "-o", "lab.yaml"]
    (here / name).write_text("image: hall.png\n")
    assert cli.main(piece) == 2
    said = capsys.readouterr().err
    assert (
        said == f"wallride: {name} is there, and not from `wallride map`: name another map with -o, or move it away\n"
    )
    assert [(file.name, file.read_text()) for file in here.iterdir()] == [(name, "image: hall.png\n")]
    (here / name).unlink()
    assert [cli.main(piece) for _ in range(2)] == [0, 0], "its own it replaces"


@pytest.mark.parametrize(
    ("scale", "said"), [(1.0003, "the way as it is"), (1 / 1.03, "3.0 % too much way"), (1.02, "2.0 % too little way")]
)
def test_what_the_wheels_report_is_said_in_words(scale, said):
    assert wheel_words(scale) == f"the wheels report {said}"


def test_a_busy_computer_is_blamed_for_what_it_may_have_lost(recordings):
    lap = read_record(recordings / "piece.mcap")
    good = judge_map(lap, close_lap(lap), is_open=True)
    for gap_s, contradiction, is_blamed in ((0.0, 0.5, False), (0.7, 0.5, True), (0.0, 5.0, True)):
        said = list(advice(replace(good, reasons=("anything",), gap_s=gap_s, contradiction=contradiction)))
        assert ["not busy" in line for line in said] == [is_blamed]
    assert list(advice(good)) == []


@pytest.mark.parametrize("command", ["map", "report"])
def test_a_full_disk_leaves_no_file_and_says_so(command, recordings, here, capsys):
    with full_disk(1000):
        assert cli.main([command, str(recordings / "piece.mcap")]) == 2
    assert capsys.readouterr().err.endswith(" cannot be used: File too large; name another place\n")
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ("make", "said"),
    [(lambda path: path.write_bytes(b"no recording"), "none.mcap"), (lambda path: None, "none.mcap does not exist")],
)
def test_a_mistake_is_one_sentence(make, said, here, capsys):
    make(here / "none.mcap")
    assert cli.main(["map", "none.mcap"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_car_that_stood_has_no_map(here, capsys):
    record(here / "stood.mcap", seconds=1.0, sections={"operator": {"permit": "required"}})
    assert cli.main(["map", "stood.mcap"]) == 2
    assert "the car hardly moved" in capsys.readouterr().err
