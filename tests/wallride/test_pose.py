"""`wallride pose` from the command line: a lap is mapped, and another drive is found on the map."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from tests.sim.replay.recorded import record
from wallride import cli
from wallride.runtime.control.line_following.line_follower import DRIVES
from wallride.runtime.line_files import read_line
from wallride.runtime.map_files import read_map
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.wire import topics
from wallride.sim.mapping import pose_command
from wallride.sim.replay.drive_log import decode, read_log
from wallride.sim.replay.reenact import reenact

pytestmark = pytest.mark.usefixtures("here")
FOLLOW = {"wall_follow": {"speed_mps": 4.0}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laps")
    record(folder / "lap.mcap", seconds=16.0, sections=FOLLOW)
    record(folder / "again.mcap", seconds=6.0, sections={"wall_follow": {"speed_mps": 3.0}})
    assert cli.main(["map", str(folder / "lap.mcap"), "-o", str(folder / "lab.yaml")]) == 0
    return folder


def test_another_drive_is_found_where_the_laps_begin(folder, here, capsys):
    assert cli.main(["pose", str(folder / "again.mcap"), str(folder / "lab.yaml")]) == 0
    said = capsys.readouterr().out
    assert "again on lab: located at" in said
    assert "of the beams fit the map" in said
    assert "lost" not in said
    assert said.splitlines()[-1] == "verdict: good"
    assert (here / "again.pose.png").stat().st_size > 10_000
    rows = [line.split("; ") for line in (here / "again.pose.csv").read_text().splitlines()[2:]]
    assert {row[6] for row in rows[2:]} == {"located"}
    assert np.array(rows[0][1:4], float) == pytest.approx(np.zeros(3), abs=0.05)


def test_a_car_with_the_map_finds_and_records_the_same_poses_to_the_bit(folder, here, capsys):
    map_ = folder / "lab.yaml"
    sections = {"wall_follow": {"speed_mps": 3.0}, "map": {"file": str(map_)}}
    car, twin = record(here / "own.mcap", seconds=5.0, sections=sections, known=read_map(map_))
    pose = car.status()["pose"]
    assert pose["whereabouts"] == "located"
    began = twin.world.start
    off = complex(twin.vehicle.pose.x_m - began.x_m, twin.vehicle.pose.y_m - began.y_m)
    assert abs(complex(pose["x_m"], pose["y_m"]) - off) < 0.5, "it has braked since"
    assert cli.main(["pose", "own.mcap", str(map_), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["own_poses"] > 150
    assert told["own_poses_same"] == told["own_poses"]


def test_the_rows_of_a_car_with_the_map_are_its_own(folder, here, monkeypatch):
    map_ = folder / "lab.yaml"
    record(here / "own.mcap", seconds=2.0, sections={"map": {"file": str(map_)}}, known=read_map(map_))
    monkeypatch.setattr(pose_command, "track", lambda *_: pytest.fail("the drive is found anew"))
    assert cli.main(["pose", "own.mcap", str(map_), "--tum"]) == 0
    log = read_log(here / "own.mcap")
    own = [decode(message).pose.pose.position.x for message in log.of(topics.POSE)]
    rows = [float(line.split("; ")[1]) for line in (here / "own.pose.csv").read_text().splitlines()[2:]]
    found = [x_m for x_m in rows if np.isfinite(x_m)]
    assert len(own) > 50
    assert found[: len(own)] == pytest.approx(own, abs=1e-4)
    trajectory = np.loadtxt(here / "own.pose.tum")
    assert trajectory[:, 1] == pytest.approx(found, abs=1e-4)
    stamps_s = [message.stamp_ns / NS for message in log.of(topics.POSE)]
    assert trajectory[: len(own), 0] == pytest.approx(stamps_s, abs=1e-4), "the time since 1970, as of its topics"
    with pytest.raises(pytest.fail.Exception):
        cli.main(["pose", "own.mcap", str(map_), "--anywhere"])


def test_a_car_drives_the_line_of_its_map_and_decides_the_same_to_the_bit(folder, here, capsys):
    map_ = folder / "lab.yaml"
    assert cli.main(["line", str(map_), "-o", str(here / "lab.line.csv"), "--speed", "3"]) == 0
    line = read_line(here / "lab.line.csv")
    follow = {"method": "line", "first_lap_share": 1.0}
    sections = {"wall_follow": follow, "map": {"file": str(map_), "line": str(here / "lab.line.csv")}}
    car, twin = record(here / "race.mcap", seconds=8.0, sections=sections, known=read_map(map_), line=line)
    on_line = [fields for _, fields in read_log(here / "race.mcap").json("decision") if fields["reason"] == DRIVES]
    assert on_line[-1]["speed_mps"] > 2.0
    assert twin.vehicle.speed_mps == 0.0, "the drive ends once the car stands"
    assert car.status()["pose"]["race"]["speed_share"] == 1.0
    heard = [len(payload) for key, payload in car.bus.heard if key.rpartition("/")[2] == "line"]
    assert len(heard) == 2, "at once, and again after 5 s"
    log = read_log(here / "race.mcap")
    verdict = reenact(log)
    assert (verdict.first, verdict.exact, verdict.notes, verdict.changed) == (None, True, [], "")
    assert verdict.answers > 250
    (folder / "lab.walls.csv").rename(folder / "away")
    (folder / "lab.yaml").rename(folder / "away.yaml")
    try:
        without = reenact(log)
    finally:
        (folder / "away").rename(folder / "lab.walls.csv")
        (folder / "away.yaml").rename(folder / "lab.yaml")
    assert without.first is not None
    assert without.changed.startswith("it drove a race line, whose map cannot be read: ")
    assert cli.main(["line", str(map_), "-o", str(here / "lab.line.csv"), "--speed", "2.9"]) == 0
    assert reenact(log).changed == "the line that it drove by is not there, or has changed since"
    assert reenact(log, ["map.line="]).changed == "", "which is another one by wish"


def test_poses_of_another_map_are_told(folder, here, capsys):
    other = replace(read_map(folder / "lab.yaml"), scale=0.9)
    record(here / "own.mcap", seconds=2.0, sections={"map": {"file": "other/lab.yaml"}}, known=other)
    assert cli.main(["pose", "own.mcap", str(folder / "lab.yaml")]) == 0
    assert re.search(r"of the car's own \d+ poses \d are found again to the bit: another map", capsys.readouterr().out)


def test_the_mapped_drive_itself_keeps_to_the_path_of_the_map(folder, capsys):
    assert cli.main(["pose", str(folder / "lap.mcap"), str(folder / "lab.yaml"), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["located"] > 0.99 * told["scans"]
    assert told["losses_s"] == []
    assert told["off_path_rms_m"] < 0.02
    assert told["off_path_p99_m"] < 0.05
    assert told["fits_p1"] > 0.8


def test_on_a_symmetric_map_a_start_anywhere_is_not_guessed(folder, capsys):
    piece = str(folder / "again.mcap")
    code = cli.main(["pose", piece, str(folder / "lab.yaml"), "--anywhere", "-o", "any.csv"])
    said = capsys.readouterr().out
    assert (code, "these places look alike" in said) in {(1, True), (0, False)}
    if code:
        assert said.count(" deg)") >= 2


def test_another_building_is_told(folder, here, capsys):
    record(here / "elsewhere.mcap", world="straight", seconds=3.0)
    assert cli.main(["pose", "elsewhere.mcap", str(folder / "lab.yaml")]) == 1
    said = capsys.readouterr().out
    assert "no place of the map" in said
    assert said.splitlines()[-1].startswith("verdict: doubtful: located at 0 of ")


@pytest.mark.parametrize(
    ("figures", "reasons"),
    [
        ({}, []),
        ({"fits": 0.72, "losses_s": [1.0, 2.0], "located": 900}, []),
        ({"fits": 0.64, "losses_s": [1.0] * 10}, ["only 64 % of the beams fit", "lost 10 times"]),
        ({"located": 137}, ["located at 137 of 1601 scans"]),
        ({"located": 600, "ambiguous": 1001}, []),  # two places looked alike for a while
        ({"located": 0, "ambiguous": 1601}, ["located at 0 of 1601 scans"]),
    ],
)
def test_what_speaks_against_the_poses_of_a_drive(figures, reasons):
    told = {"scans": 1601, "located": 1601, "ambiguous": 0, "fits": 0.98, "losses_s": [], **figures}
    assert list(pose_command.reasons_against(told)) == reasons


def test_a_map_before_its_recording_is_told(folder, capsys):
    recording, map_ = str(folder / "again.mcap"), str(folder / "lab.yaml")
    assert cli.main(["pose", map_, recording]) == 2
    assert f"the recording comes first: wallride pose {recording} {map_}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("map_", "said"), [("none.yaml", "none.yaml; give the path of a map's"), ("again.mcap", "again.mcap: ")]
)
def test_a_mistake_is_one_sentence(folder, map_, said, capsys):
    path = map_ if map_ == "none.yaml" else str(folder / map_)
    assert cli.main(["pose", str(folder / "again.mcap"), path]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
