"""`benchmarks.lab recordings`: what must hold on the real ones, and how it meets folders that hold something else."""

import json
import warnings

import numpy as np
import pytest

from benchmarks.lab import recordings
from benchmarks.lab.__main__ import parsed
from benchmarks.lab.recorded.recording_pictures import WINDOW_TITLE_LETTERS, wrapped
from benchmarks.lab.recorded.replay import replay
from tests.sim.recordings.recorded_drives import RACECAR, real
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.command import chosen, run


def options(*arguments):
    return parsed(["recordings", *arguments])


def figures_of(name):
    real(name)
    return recordings.measure(
        Cell("benchmarks.lab.recordings", str(RACECAR / f"{name}.npz"), "ball+swept", 0.0, 0.8, "left", 0)
    )


@pytest.mark.parametrize("name", ["t1_standing_odom_nav", "t1_standing_all_topics"])
def test_a_standing_car_sees_a_standing_wall(name):
    figures = figures_of(name)
    lowest_m, _, _, _, highest_m = figures["wall_m"]
    assert figures["stands"]
    assert highest_m - lowest_m < 0.02
    lowest_rad, _, _, _, highest_rad = figures["wall_heading_rad"]
    assert highest_rad - lowest_rad < np.radians(0.5)
    assert figures["wall_jumps"] == 0
    assert figures["dirty_beams"] == 0
    assert figures["way_m"] == 0.0
    assert figures["walker_scans"] == 0


def test_a_real_corridor_is_measured_to_a_millimetre():
    figures = figures_of("t14_straight_1mps")
    assert figures["wall_noise_m"] < 0.0015
    assert figures["wall_jumps"] == 0
    assert figures["episodes"] == []
    assert figures["side"] == "left"
    assert abs(figures["follower_off_m"]) < 0.005, "what it follows is the wall, not the dirt on the window"


@pytest.mark.parametrize("name", ["t14_safety_gap3s", "t3_wall_data"])
def test_nobody_is_stopped_for_ghosts_or_for_the_cars_own_parts(name):
    """A cable's trail and the end of a wall looked like walkers; another car's rack sticks out of our outline."""
    figures = figures_of(name)
    assert figures["driving_scans"] > 100
    assert figures["episodes"] == []


@pytest.mark.parametrize("name", [
    "t14_inside_corner_2mps", "t14_outside_corner_gap14s", "t3_crash_1_5mps", "t3_wall_data",
])  # fmt: skip
def test_what_is_followed_from_the_first_scan_on_is_the_worlds(name):
    """What is near behind the shoulders and not in doubt at once is followed in the first four."""
    figures = figures_of(name)
    assert abs(figures["first_off_m"]) < 0.05
    assert figures["stops"] == 0


def test_people_who_walk_are_still_seen():
    """A person walks up to the car that has stopped, and lifts it; what is near behind is doubted until it moves."""
    assert figures_of("t14_straight_1mps")["walker_scans"] > 15


def test_what_four_drives_of_one_car_have_at_the_same_beams_is_dirt():
    """At 24 to 38 degrees it reads 0.5 to 0.75 m while a wall is near, and metres through it else: no false claim."""
    done = replay(real("t14_inside_corner_2mps"), "left")
    at_deg = (np.flatnonzero(done.health._beams.dirty) - 540) / 4
    ahead_deg = at_deg[(at_deg > 0) & (at_deg < 90)]
    assert 24 <= ahead_deg.min() <= 30
    assert 34 <= ahead_deg.max() <= 39
    there = np.array([judged.scan.ranges_m[540 + 4 * 32] for judged in done.judged])
    assert np.count_nonzero(there < 0.75) > 50
    assert np.count_nonzero(there > 1.8) > 20
    assert any("around 3" in words and words.endswith("are dirty: clean the window") for words in done.health.words)


def test_the_brake_run_is_braked_later_by_swept_and_stands_on_every_floor():
    figures = figures_of("t3_brake_1_75mps")
    really = figures["at_wall"]
    assert really["braked_gap_m"] == pytest.approx(1.4, abs=0.1)
    assert really["rest_m"] == pytest.approx(0.92, abs=0.05)
    assert [run["mu"] for run in figures["reenacted"]] == [0.8, 0.5]
    for run_again in figures["reenacted"]:
        assert run_again["touched_mps"] == 0.0
        assert 0.05 < run_again["rest_m"] < 0.5
        assert run_again["slower_gap_m"] < really["braked_gap_m"]


def test_scans_of_several_lidars_on_one_topic_are_not_judged():
    assert "several lidars" in figures_of("t3_foreign_publishers")["skipped"]


def test_the_command_writes_table_json_and_pictures(tmp_path, capsys):
    real("t1_standing_odom_nav")
    file, plots = tmp_path / "figures.json", tmp_path / "pictures"
    path = str(RACECAR / "t14_inside_corner_2mps.npz")
    assert run(options(path, "--jobs", "1", "--json", str(file), "--plot", str(plots))) == 0
    (cell,) = json.loads(file.read_text())["cells"]
    assert cell["name"] == "t14_inside_corner_2mps"
    pictures = sorted(picture.name for picture in plots.iterdir())
    assert "recordings-t14_inside_corner_2mps-window.png" in pictures
    assert len(pictures) == 1 + len(cell["episodes"])
    said = capsys.readouterr().out
    assert "what the car would have seen" in said
    assert "where safety would have interfered" in said


def test_a_file_that_is_no_recording_is_skipped_with_its_reason(tmp_path):
    (tmp_path / "numbers.npz").write_bytes(b"nothing")
    cells = recordings.cells(chosen(options(str(tmp_path))))
    figures = [cell.named(recordings.measure(cell)) for cell in cells]
    assert "numbers" in figures[0]["skipped"]
    table = recordings.tables(figures)[0]
    assert table.rows == ()
    assert "skipped numbers.npz" in table.notes[0]


@pytest.mark.parametrize(("place", "words"), [("nowhere", "does not exist"), ("", "there is no .npz")])
def test_a_wrong_folder_is_said_before_anything_is_read(tmp_path, place, words, capsys):
    with pytest.raises(SystemExit, match="2"):
        options(str(tmp_path / place))
    assert words in capsys.readouterr().err


def at_wall(gap_m, speed_mps):
    return {"braked_scan": 4, "braked_gap_m": gap_m, "braked_mps": speed_mps, "rest_m": 0.3}


def row(path, **more):
    name = path.rpartition("/")[2].rpartition(".")[0]
    return {"scenario": path, "name": name, "at_wall": at_wall(0.5, 1.0), "reenacted": [], **more}


def test_a_run_that_met_no_wall_says_so():
    cells = [
        line[3] for line in recordings._at_walls([row("a/x.npz"), row("a/y.npz", at_wall=at_wall(None, 2.0))]).rows
    ]
    assert cells == ["0.50 m, 1.00 m/s", "at no wall, 2.00 m/s"]
    assert recordings._at(None, None) == "-"


def test_files_of_one_stem_are_told_apart():
    rows = [row(path) for path in ("a/x.npz", "a/x.bag", "b/x.bag", "a/y.npz")]
    assert [one["name"] for one in recordings._told_apart(rows)] == ["x.npz", "a/x.bag", "b/x.bag", "y"]


def test_a_median_of_nothing_is_none_and_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert recordings._median(np.full(5, np.nan)) is None
        assert recordings._median(np.array([np.nan, 1.0, 3.0])) == 2.0


def test_no_line_of_a_title_is_longer_than_its_picture():
    words = "; ".join(f"beams {n} to {n + 9} are dirty: clean the window" for n in range(0, 200, 20))
    lines = wrapped(f"a recording: {words}\nsecond line", WINDOW_TITLE_LETTERS).split("\n")
    assert max(map(len, lines)) <= WINDOW_TITLE_LETTERS
    assert lines[-1] == "second line"
