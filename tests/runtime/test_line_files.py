"""The file of a race line: read as written, and refused with what to do."""

import errno
from pathlib import Path

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import circle
from tests.runtime.test_map_files import box, round_the_box, write
from wallride.runtime.control.safety.promised_way import MOTOR_BRAKE_MPS2
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.line_files import AGAINST_LAP, check_course, read_course, read_line, why_no_line
from wallride.runtime.map_files import MapError, fingerprint, walls_text
from wallride.runtime.settings.pose_map import PoseMapSettings
from wallride.runtime.settings.tree import Settings

CAR = CarSettings(max_steering_rad=0.6)
"""It turns on 0.48 m: the room of `box` is small."""


def text(line, **changes):
    columns = {
        "s": line.along_m, "x": line.places_m.real, "y": line.places_m.imag, "yaw": line.yaw_rad,
        "kappa": line.curvature_radpm, "v": line.speed_mps, "a": 0 * line.along_m, "away": 0 * line.along_m + 1.0,
    }  # fmt: skip
    table = np.column_stack(list((columns | changes).values()))
    return "# a line\n" + "\n".join("; ".join(f"{one:.5f}" for one in row) for row in table) + "\n"


def test_a_line_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "lab.line.csv"
    path.write_text(text(circle()))
    line = read_line(path)
    assert line.length_m == pytest.approx(circle().length_m, abs=0.01)
    assert line.curvature_at(2.0) == pytest.approx(1 / 3.0, abs=1e-4)
    assert line.speed_at(2.0) == 2.0


def test_speeds_that_no_motor_brakes_for_are_lowered_before_the_slow_place(tmp_path):
    drawn_mps = np.where(np.abs(circle().along_m - 6.0) < 0.2, 1.0, 6.0)
    path = tmp_path / "lab.line.csv"
    path.write_text(text(circle(), v=drawn_mps))
    line = read_line(path)
    fallen_mps2 = (line.speed_mps**2 - np.roll(line.speed_mps, -1) ** 2) / (2.0 * line.length_m / line.along_m.size)
    assert fallen_mps2.max() == pytest.approx(MOTOR_BRAKE_MPS2, rel=0.01)
    assert (line.speed_mps == drawn_mps)[(line.along_m > 5.8) | (line.along_m < 2.0)].all()


@pytest.fixture
def map_(tmp_path):
    return write(tmp_path, box())


@pytest.fixture
def beside(map_):
    """The line of the map."""
    return map_.with_name(f"{map_.stem}.line.csv")


def in_the_box(speed_mps=2.0, shift=0.0):
    """Return the text of a line in the room of `box`."""
    line = circle(0.6, speed_mps)
    return text(line, x=line.places_m.real + 1.0 + shift, y=line.places_m.imag - 0.5)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("# nothing\n", "0 points are no line"),
        ("1; 2; 3\n", "line 1: not s_m; x_m"),
        ("nan; 0; 0; 0; 0; 1; 0; 1\n", "line 1: not s_m"),
        (text(circle(), v=circle().speed_mps - 3.0), "line 2: vx_mps has to be 0.3 to 50, not -1"),
        (text(circle(), v=circle().speed_mps - 1.9), "line 2: vx_mps has to be 0.3 to 50, not 0.1"),
        (text(circle(), yaw=circle().yaw_rad - np.pi / 2), "after s 0 m yaw_rad is -90 degrees off .* from the x axis"),
        (text(circle(), yaw=np.degrees(circle().yaw_rad)), "yaw_rad is .* degrees off the way"),
        (text(circle(), x=circle().places_m.imag, y=circle().places_m.real), "yaw_rad is .* degrees off the way"),
        (text(circle(), kappa=-circle().curvature_radpm), "after s 0 m kappa_radpm is not the turn of yaw_rad"),
        (text(circle(), kappa=circle().curvature_radpm + 9.0 * (circle().along_m > 18.0)), "after s 16.9.* kappa"),
        ("\n".join(text(circle()).splitlines()[:60]), "the last joins the first; after s 5.8"),
    ],
)
def test_a_file_that_is_no_line_is_refused_with_its_place(tmp_path, content, said):
    path = tmp_path / "bad.line.csv"
    path.write_text(content)
    with pytest.raises(MapError, match=said):
        read_line(path)


def test_the_line_beside_the_map_is_taken_and_another_by_its_name(tmp_path, map_, beside):
    assert read_course(PoseMapSettings(), CAR) is None
    assert read_course(PoseMapSettings(file=str(map_)), CAR).line is None
    beside.write_text(in_the_box(1.0))
    assert read_course(PoseMapSettings(file=str(map_)), CAR).line.speed_at(0.0) == 1.0
    other = tmp_path / "other.csv"
    other.write_text(in_the_box(3.0))
    named = PoseMapSettings(file=str(map_), line=str(other))
    assert read_course(named, CAR).line.speed_at(0.0) == 3.0
    other.write_text(f"# a line{AGAINST_LAP}\n{other.read_text()}")
    map_.with_name(f"{map_.stem}.walls.csv").write_text(walls_text(round_the_box(), 1.0, "of a lap"))  # and so a start
    courses = [read_course(one, CAR) for one in (PoseMapSettings(file=str(map_)), named)]
    assert [course.line.is_against_lap for course in courses] == [False, True]
    assert [len(course.localizer._starts) for course in courses] == [1, 2], "it may stand there either way round"
    with pytest.raises(MapError, match=r"none\.csv: No such file"):
        read_course(PoseMapSettings(file=str(map_), line=str(tmp_path / "none.csv")), CAR)


@pytest.mark.parametrize("changed", [np.flipud, lambda shades: shades[:, :-1]])
def test_the_line_of_another_map_is_refused_with_the_next_step(tmp_path, map_, beside, changed):
    beside.write_text(in_the_box().replace("# a line", f"# a line, map {fingerprint(map_)}"))
    assert read_course(PoseMapSettings(file=str(map_)), CAR).line is not None
    write(tmp_path, changed(box()))
    with pytest.raises(MapError, match=f"the line of another map than .*: wallride line {map_} -o {beside}"):
        read_course(PoseMapSettings(file=str(map_)), CAR)
    assert read_line(beside).length_m > 1.0, "without a map it is a line as any"


@pytest.mark.parametrize(
    ("car", "said"),
    [
        ({"max_steering_rad": 0.3}, r"after s [\d.]+ m it turns on 0\.60 m, and this car needs 1\.07 m"),
        ({"half_width_m": 0.3}, r"after s 0\.0 m it is 0\.20 m from a wall, and half of this car is 0\.30 m wide"),
    ],
)
def test_a_line_that_this_car_cannot_steer_or_is_too_wide_for_is_refused_with_the_next_step(map_, beside, car, said):
    line = circle(0.6)
    beside.write_text(text(line, x=line.places_m.real + 1.0, y=line.places_m.imag - 0.5, away=0.0 * line.along_m + 0.2))
    assert read_course(PoseMapSettings(file=str(map_)), CAR).line is not None
    check_course(map_)  # a program beside the car does not know what it steers
    with pytest.raises(MapError, match=rf"m\.line\.csv: {said}\. Make it again: wallride line {map_}$"):
        read_course(PoseMapSettings(file=str(map_)), CAR.model_copy(update=car))


@pytest.mark.parametrize("shift", [0.9, -3.0, 1e9])
def test_a_line_through_walls_or_beside_the_map_is_refused_with_its_place(map_, beside, shift):
    beside.write_text(in_the_box(shift=shift))
    with pytest.raises(MapError, match=r"m\.line\.csv: the line leads through what is not free, at x [-0-9]+\.\d m, y"):
        read_course(PoseMapSettings(file=str(map_)), CAR)


def test_a_map_in_a_folder_of_another_user_is_told_where_it_is_read(map_, monkeypatch):
    def closed(self, **_):
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    follow = Settings.model_validate({"wall_follow": {"method": "line"}}).wall_follow
    assert "beside the map; make it" in why_no_line(follow, PoseMapSettings(file=str(map_)))
    monkeypatch.setattr(Path, "stat", closed)
    assert why_no_line(follow, PoseMapSettings(file=str(map_))) == ""
    with pytest.raises(MapError, match=r"\.yaml: Permission denied$"):
        read_course(PoseMapSettings(file=str(map_)), CAR)
