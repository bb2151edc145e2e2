"""`wallride sim --race MAP`: its world and settings, and the figures of its laps."""

import argparse
import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import circle
from tests.runtime.test_line_files import text
from tests.runtime.test_map_files import box, write
from wallride.runtime.line_files import AGAINST_LAP
from wallride.runtime.map_files import fingerprint
from wallride.runtime.settings.tree import Settings, SettingsError
from wallride.sim.figures.summary import Sample
from wallride.sim.figures.tum import tum_text
from wallride.sim.live.asked_scene import asked_world
from wallride.sim.live.record import Record
from wallride.sim.racing.race import (
    Race,
    in_world,
    race_figures,
    sees_its_lap,
    take_race,
    trajectory_errors_m,
    with_lap,
    world_words,
)
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world

START = Pose(2.0, -1.0, 0.5)


@pytest.fixture
def race(tmp_path):
    (tmp_path / "lab.yaml").write_text("# world: track:seed=7\n")
    (tmp_path / "lab.line.csv").write_text(text(circle(speed_mps=4.0)))
    return tmp_path / "lab.yaml"


def options(race, **more):
    return argparse.Namespace(
        **{"race": race, "world": None, "pose": None, "assignments": ["wall_follow.side=right"], **more}
    )


def test_the_map_tells_world_line_and_speed(race):
    chosen = options(race)
    take_race(chosen)
    assert chosen.world == "track:seed=7"
    assert chosen.assignments[-1] == "wall_follow.side=right", "what the command line says goes first"
    assert {"wall_follow.method=line", "car.max_speed_mps=4.400", f"map.file={race}"} <= set(chosen.assignments)
    none = options(None)
    assert take_race(none) is None
    assert (none.world, none.assignments) == ("loop", ["wall_follow.side=right"])


@pytest.mark.parametrize("named", ["loop", "corridor", "levine.yaml"])
def test_a_world_that_is_named_is_driven_in_and_said_to_be_another(race, named):
    race.write_text("# world: track:seed=7 --pose 4,-3,0\n")
    chosen = options(race, world=named)
    found = take_race(chosen)
    assert (chosen.world, found.origin) == (named, None)
    assert found.notice == f"lab.yaml is the map of a lap in track:seed=7, not in {named}"
    same = options(race, world="track:seed=7")
    assert (take_race(same).notice, take_race(same).origin) == ("", Pose(4.0, -3.0, 0.0))


def test_the_world_of_a_map_is_found_where_it_was_beside_the_map_or_asked_for(race, tmp_path, monkeypatch):
    drawn = tmp_path / "hall" / "skirk.yaml"
    drawn.parent.mkdir()
    drawn.touch()
    monkeypatch.chdir(tmp_path)
    for told in (drawn, "hall/skirk.yaml"):
        race.write_text(f"# world: {told} --pose 1,2,3\n")
        chosen = options(race)
        assert take_race(chosen).origin == Pose(1.0, 2.0, 3.0)
        assert chosen.world == str(told)
    assert world_words("hall/skirk.yaml", "left", None) == f"{drawn} --side left"
    race.write_text("# world: skirk.yaml\n")
    with pytest.raises(SettingsError, match=r"skirk\.yaml, is not here; name it first: wallride sim WORLD --race"):
        take_race(options(race))
    named = options(race, world="hall/skirk.yaml")
    assert take_race(named).notice == ""
    (tmp_path / "skirk.yaml").touch()
    monkeypatch.chdir("/")
    beside = options(race)
    take_race(beside)
    assert beside.world == str(tmp_path / "skirk.yaml")
    race.write_text("# world: /moved/since/skirk.yaml --side left\n")
    take_race(beside := options(race))
    assert beside.world == str(tmp_path / "skirk.yaml")
    for told in ("skirk", "lab.yaml"):  # as maps told it once; and this map itself is not what it was made of
        race.write_text(f"# world: {told}\n")
        with pytest.raises(SettingsError, match=f"{told}, is not here"):
            take_race(options(race))


def test_a_map_that_is_the_world_itself_lies_in_it_as_it_is(race):
    told = options(race, world=str(race))
    found, world = take_race(told), replace(load_world("loop"), start=Pose(0.0, 3.0, 0.2))
    assert told.world == str(race)
    assert (found.origin_in(world), found.start_in(world)) == (Pose(0.0, 0.0, 0.0), world.start)


def test_what_is_said_of_the_start_is_understood_again(race):
    race.write_text(f"# world: {world_words('loop', 'left', START)}\n")
    assert take_race(options(race)).origin == START


@pytest.mark.parametrize("followed", ["left", "right"])
def test_the_world_is_the_one_of_the_lap_whichever_wall_is_followed(race, followed):
    settings = Settings.model_validate({"wall_follow": {"side": followed}})
    for words, side in (
        (world_words("loop", "left", None), "left"),
        (world_words("loop", "right", START), "right"),
        ("loop", followed),  # as maps told it once
    ):
        race.write_text(f"# world: {words}\n")
        chosen = options(race, seed=0)
        chosen.race = take_race(chosen)
        assert asked_world(chosen, settings).side == side
        chosen = options(race, seed=0, world="corridor")
        chosen.race = take_race(chosen)
        assert asked_world(chosen, settings).side == followed, "another world is no lap's"


def test_a_map_without_line_or_world_is_refused_in_a_sentence(race):
    race.write_text("image: m.pgm\n")
    with pytest.raises(SettingsError, match="does not tell its world"):
        take_race(options(race))
    race.with_name("lab.line.csv").unlink()
    with pytest.raises(SettingsError, match="no race line beside it"):
        take_race(options(race))


def test_the_race_begins_where_the_lap_did_along_the_line(race):
    race.write_text("# world: track:seed=7 --pose 4,-3,0.5\n")
    lap, world = take_race(options(race)), load_world("loop")
    assert lap.start_in(world) == Pose(4.0, -3.0, 0.5)
    beside = race.with_name("lab.line.csv")
    beside.write_text(beside.read_text().replace("# a line", f"# a line{AGAINST_LAP}"))
    begun = take_race(options(race)).start_in(world)
    assert (begun.x_m, begun.y_m, begun.yaw_rad) == pytest.approx((4.0, -3.0, 0.5 - math.pi))


def test_another_line_of_the_map_is_the_one_that_is_raced(race, tmp_path):
    other = tmp_path / "other.csv"
    other.write_text(text(circle(speed_mps=3.0)))
    chosen = options(race, assignments=[f"map.line={other}"])
    assert take_race(chosen).line.speed_mps.max() == 3.0
    assert "car.max_speed_mps=3.300" in chosen.assignments
    config = tmp_path / "car.toml"
    config.write_text(f'[map]\nline = "{other}"\n')
    assert take_race(options(race), config).line.speed_mps.max() == 3.0


def test_what_is_no_good_map_is_refused_in_a_sentence(race):
    with pytest.raises(SettingsError, match=r"none\.yaml: there is no such file; a map is made"):
        take_race(options(race.with_name("none.yaml")))
    with pytest.raises(SettingsError, match="is no map"):
        take_race(options(race.with_name("loop")))
    race.write_text("# map by wallride of a.mcap, refused: the ring is open\n# world: loop\n")
    with pytest.raises(SettingsError, match="the map is refused: the ring is open"):
        take_race(options(race))


def test_the_line_of_another_map_is_refused(race):
    line = race.with_name("lab.line.csv")
    write(race.parent, box()).rename(race)
    line.write_text(line.read_text().replace("# a line", f"# a line, map {fingerprint(race)}"))
    race.write_text(f"# world: loop\n{race.read_text()}")
    take_race(options(race))
    race.write_text(race.read_text().replace("0.05", "0.06"))
    with pytest.raises(SettingsError, match=r"lab\.line\.csv: the line of another map .* wallride line"):
        take_race(options(race))


def test_the_line_is_the_lap():
    world = with_lap(load_world("loop"), Race(circle(), START))
    assert world.lap is not None
    assert world.lap.length_m == pytest.approx(circle().length_m, abs=0.05)
    turn = cmath.exp(0.5j)
    assert complex(*world.lap.points_m[0]) == pytest.approx(complex(2.0, -1.0) + 3.0 * turn, abs=1e-4)


@pytest.mark.parametrize(("pose", "is_seen"), [("-3,3,0", True), ("0,0,0", False), ("-7,0,0", False)])
def test_a_car_outside_of_the_course_is_told(pose, is_seen):
    """The course is the corridor of the loop, and (0, 0) lies in its block."""
    world = load_world("loop")
    assert sees_its_lap(world, Pose(*map(float, pose.split(",")))) is is_seen
    assert sees_its_lap(replace(world, lap=None), Pose(0.0, 0.0, 0.0))


def test_the_true_trajectory_is_told_on_the_map():
    record = Record(began_unix_s=1000.0)
    record.note(Sample(0.5, START.x_m, START.y_m, START.yaw_rad, 2.0, 1.0, 1.0))
    ahead = START.ahead(2.0, 0.0)
    record.note(Sample(1.5, ahead.x_m, ahead.y_m, ahead.yaw_rad + math.pi / 2, 2.0, 1.0, 1.0))
    record.note(Sample(2.5, math.nan, 0.0, 0.0, 2.0, 1.0, 1.0))
    head, *rows = tum_text(record.trajectory(START)).splitlines()
    assert head == "# timestamp tx ty tz qx qy qz qw"
    told = np.array([list(map(float, row.split())) for row in rows])
    half = math.sqrt(0.5)
    assert told == pytest.approx(
        np.array([[1000.5, 0, 0, 0, 0, 0, 0, 1], [1001.5, 2, 0, 0, 0, 0, half, half]]), abs=1e-6
    )


def test_errors_of_line_and_trajectory():
    places = in_world(circle(), START)
    record, drift = Record(), cmath.exp(0.3j)
    for k, place in enumerate(places):
        record.note(Sample(0.1 * k, place.real, place.imag, 0.0, 2.0, 1.0, 1.0))
    record.began_s = 100.0
    found = [drift * place + complex(5.0, 5.0) + 0.02 * (-1) ** k for k, place in enumerate(places)]
    record.poses = [(100.0 + 0.1 * k, one.real, one.imag) for k, one in enumerate(found)]
    told = race_figures(*record.as_driven(), circle(), START, [0.1 * len(places)])
    assert told["line_rms_m"] == pytest.approx(0.0, abs=0.005)
    assert told["trajectory_rms_m"] == pytest.approx(0.02, abs=0.001), "a rigid motion is no error"
    assert not trajectory_errors_m(*Record().as_driven()).size
    record.poses = record.poses[:9]
    few = race_figures(*record.as_driven(), circle(), START, [])
    assert few["trajectory_rms_m"] is None, "a rigid motion alone brings few poses to where they are"
    assert race_figures(*Record().as_driven(), circle(), START, [])["line_rms_m"] is None
    assert told["trajectory_largest_m"] == pytest.approx(0.02, abs=0.001)
