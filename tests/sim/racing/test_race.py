"""`wallride sim --race MAP`: its world and settings, and the figures of its laps."""

import argparse
import cmath

import pytest

from tests.runtime.control.line_following.lines import circle
from tests.runtime.test_line_files import text
from tests.runtime.test_map_files import box, write
from wallride.runtime.map_files import fingerprint
from wallride.runtime.settings.tree import SettingsError
from wallride.sim.figures.summary import Sample
from wallride.sim.live.record import Record
from wallride.sim.racing.race import in_world, race_figures, take_race, trajectory_errors_m, with_lap
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
        **{"race": race, "world": "loop", "pose": None, "assignments": ["wall_follow.side=right"], **more}
    )


def test_the_map_tells_world_line_and_speed(race):
    chosen = options(race)
    take_race(chosen)
    assert chosen.world == "track:seed=7"
    assert chosen.assignments[-1] == "wall_follow.side=right", "what the command line says goes first"
    assert {"wall_follow.method=line", "car.max_speed_mps=4.400", f"map.file={race}"} <= set(chosen.assignments)
    named = options(race, world="levine.yaml")
    take_race(named)
    assert named.world == "levine.yaml"
    none = options(None)
    take_race(none)
    assert (none.world, none.assignments) == ("loop", ["wall_follow.side=right"])


def test_a_map_without_line_or_world_is_refused_in_a_sentence(race):
    race.write_text("image: m.pgm\n")
    with pytest.raises(SettingsError, match="does not tell its world"):
        take_race(options(race))
    race.with_name("lab.line.csv").unlink()
    with pytest.raises(SettingsError, match="no race line beside it"):
        take_race(options(race))


def test_the_race_begins_where_the_lap_did(race):
    race.write_text("# world: track:seed=7 --pose 4,-3,0\n")
    chosen, named = options(race), options(race, pose="1,2,3")
    take_race(chosen)
    take_race(named)
    assert (chosen.world, chosen.pose, named.pose) == ("track:seed=7", "4,-3,0", "1,2,3")


def test_what_is_no_good_map_is_refused_in_a_sentence(race):
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


def test_the_line_is_the_lap(race):
    world = with_lap(load_world("loop"), race, START)
    assert world.lap is not None
    assert world.lap.length_m == pytest.approx(circle().length_m, abs=0.05)
    turn = cmath.exp(0.5j)
    assert complex(*world.lap.points_m[0]) == pytest.approx(complex(2.0, -1.0) + 3.0 * turn, abs=1e-4)


def test_errors_of_line_and_trajectory(race):
    places = in_world(circle(), START)
    record, drift = Record(), cmath.exp(0.3j)
    for k, place in enumerate(places):
        record.note(Sample(0.1 * k, place.real, place.imag, 0.0, 2.0, 1.0, 1.0))
    record.began_s = 100.0
    found = [drift * place + complex(5.0, 5.0) + 0.02 * (-1) ** k for k, place in enumerate(places)]
    record.poses = [(100.0 + 0.1 * k, one.real, one.imag) for k, one in enumerate(found)]
    told = race_figures(*record.as_driven(), race, START, [0.1 * len(places)])
    assert told["line_rms_m"] == pytest.approx(0.0, abs=0.005)
    assert told["trajectory_rms_m"] == pytest.approx(0.02, abs=0.001), "a rigid motion is no error"
    assert not trajectory_errors_m(*Record().as_driven()).size
    assert race_figures(*Record().as_driven(), race, START, [])["line_rms_m"] is None
    assert told["trajectory_largest_m"] == pytest.approx(0.02, abs=0.001)
