"""`wallride line` from the command line: its files, its figures, its errors."""

import json
import os
from itertools import pairwise

import numpy as np
import pytest

from wallride import cli
from wallride.runtime.line_files import read_line
from wallride.sim.racing.raceline import _with_speed

pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def without_picture(monkeypatch):
    """Write no picture: to draw one takes as long as to find the line."""
    monkeypatch.setattr("wallride.sim.racing.command.save_picture", lambda file, *_: file.write(b"a picture"))


@pytest.fixture
def along_the_middle(monkeypatch, without_picture):
    """Let the line be the middle of the way round, where what counts is which way round and which file."""
    middle = lambda ring_m, space, grip, **_: _with_speed(ring_m, space, grip)  # noqa: E731
    monkeypatch.setattr("wallride.sim.racing.command.race_line", middle)


@pytest.fixture
def lab(here):
    """The settings file of a map with one way round."""
    cells = np.full((80, 120), 254, np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = cells[25:55, 25:95] = 0
    (here / "lab.pgm").write_bytes(b"P5 120 80 255\n" + cells.tobytes())
    (here / "lab.yaml").write_text("image: lab.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n")
    return here / "lab.yaml"


def test_the_file_is_one_that_programs_of_the_field_read(here, capsys):
    assert cli.main(["line", "loop"]) == 0
    said = capsys.readouterr().out
    assert "a line of 28." in said
    assert "s a lap in theory" in said
    rows = np.loadtxt(here / "loop.line.csv", delimiter=";", skiprows=3)
    along_m, x_m, y_m, yaw_rad = rows[:, :4].T
    steps_m = np.hypot(np.roll(x_m, -1) - x_m, np.roll(y_m, -1) - y_m)
    assert along_m[1:] == pytest.approx(np.cumsum(steps_m)[:-1], abs=0.01)
    turned = np.arctan2(np.roll(y_m, -1) - y_m, np.roll(x_m, -1) - x_m) - yaw_rad
    assert np.abs(np.angle(np.exp(1j * turned))).max() < 0.05
    assert 0.0 < rows[:, 5].min() <= rows[:, 5].max() <= 6.0
    assert (here / "loop.line.png").stat().st_size > 10_000


@pytest.mark.usefixtures("without_picture")
def test_a_line_is_a_path_for_another_line_the_other_way_round(here, capsys):
    assert cli.main(["line", "loop", "-o", "there.csv", "--json", "there.json"]) == 0
    assert cli.main(["line", "loop", "--path", "there.csv", "--reverse", "-o", "back.csv", "--json", "-"]) == 0
    back = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert back["lap_s"] == pytest.approx(json.loads((here / "there.json").read_text())["lap_s"], rel=0.05)
    yaw_rad = [np.loadtxt(here / name, delimiter=";")[:, 3] for name in ("there.csv", "back.csv")]
    assert np.sign([np.unwrap(yaw)[-1] - yaw[0] for yaw in yaw_rad]).tolist() in ([1, -1], [-1, 1])


@pytest.mark.usefixtures("along_the_middle")
def test_the_line_goes_beside_its_map_and_never_over_the_line_of_another(here, lab, capsys, monkeypatch):
    maps = here / "maps"
    maps.mkdir()
    for name in ("lab.pgm", "lab.yaml"):
        (here / name).rename(maps / name)
    assert cli.main(["line", "maps/lab.yaml"]) == 0
    assert "written: maps/lab.line.csv, maps/lab.line.png" in capsys.readouterr().out
    assert sorted(path.name for path in here.iterdir()) == ["maps"]
    monkeypatch.setattr(os, "access", lambda *_: False)
    for _ in range(2):  # the second time over the first, which is of this map
        assert cli.main(["line", "maps/lab.yaml"]) == 0
    assert "written: lab.line.csv, lab.line.png" in capsys.readouterr().out
    mine = (here / "lab.line.csv").read_text()
    (maps / "lab.yaml").write_text("image: lab.pgm\nresolution: 0.1\norigin: [0, 0.5, 0]\n")
    assert cli.main(["line", "maps/lab.yaml"]) == 2
    assert "maps takes no file, and lab.line.csv here is the line of another map: name one" in capsys.readouterr().err
    assert (here / "lab.line.csv").read_text() == mine


@pytest.mark.usefixtures("along_the_middle")
def test_a_line_tells_whether_it_goes_round_against_the_lap_of_its_map(here, lab):
    ways = ([], False), (["--reverse"], True), (["--side", "right"], False), (["--side", "right", "--reverse"], True)
    for options, is_against in ways:
        assert cli.main(["line", "lab.yaml", "-o", "one.csv", *options]) == 0
        assert read_line(here / "one.csv", lab).is_against_lap is is_against
    corners = [(1.2, 1.2), (10.8, 1.2), (10.8, 6.8), (1.2, 6.8), (1.2, 1.2)]
    rows = "\n".join(f"{x_m}; {y_m}" for x_m, y_m in np.vstack([np.linspace(*two, 20) for two in pairwise(corners)]))
    (here / "lab.path.csv").write_text(f"# x_m; y_m\n{rows}\n")  # to the left, as with the wall on the right
    for options, is_against in (([], False), (["--reverse"], True), (["--side", "left"], True), (ways[3][0], True)):
        assert cli.main(["line", "lab.yaml", "-o", "one.csv", *options]) == 0
        assert read_line(here / "one.csv").is_against_lap is is_against


@pytest.mark.parametrize("place", ["100,100,1", "0,5.2,1", "-8,0,0.5"])
def test_a_place_to_avoid_lies_on_the_map(place, here, capsys):
    assert cli.main(["line", "loop", f"--avoid={place}"]) == 2
    assert f"--avoid {place}: lies beside the map, whose walls lie at x -6.0 to 6.0 m" in capsys.readouterr().err


@pytest.mark.parametrize("drawn", [b"P5 120 80 255\n" + bytes(9600), b"no image"])
def test_a_refused_map_has_no_line_whatever_is_drawn_on_it(drawn, here, capsys):
    (here / "lab.pgm").write_bytes(drawn)
    about = (
        "# map by wallride of a.mcap, refused: the ring is open\nimage: lab.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n"
    )
    (here / "lab.yaml").write_text(about)
    for name, said in (
        ("lab.yaml", "the map is refused: the ring is open; drive the lap again"),
        ("lab.pgm", "is no map's .yaml"),
    ):
        assert cli.main(["line", name]) == 2
        assert capsys.readouterr().err == f"wallride: {name}: {said}\n"
    assert not (here / "lab.line.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "no world is called 'nowhere'"),
        (["none.yaml"], "none.yaml; give the path of a map's .yaml file"),
        (["straight"], "does not close on itself"),
        (["loop", "--keep", "0.1"], "--keep 0.1 m is less than the car needs"),
        (["loop", "--path", "none.csv"], "none.csv cannot be used: No such file or directory; name another place"),
        (["loop", "--path", "/dev/zero"], "/dev/zero is not the file of a path: it is longer than 20 MB"),
        (["loop", "--set", "car.max_steering_rad=0.06"], "and the car needs 5.49 m"),
        (["loop", "--set", "car.wheels=3"], "wheels"),
        (["loop", "-o", "line.png"], "-o line.png: name a file, such as loop.line.csv"),
        (["loop", "--avoid=3,0,9"], "no room for the car"),
    ],
)
def test_a_mistake_is_one_sentence(arguments, said, capsys):
    assert cli.main(["line", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert "Traceback" not in error


@pytest.mark.parametrize(
    "option",
    [["--mu", "0"], ["--mu", "1e-300"], ["--keep", "1e9"], ["--brake", "1.5"], ["--avoid", "1,2"], ["--speed", "nan"]],
)
def test_impossible_numbers_are_refused(option, capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["line", "loop", *option])
    assert option[0] in capsys.readouterr().err
