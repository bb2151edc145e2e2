"""Files to write: none takes the place of a recording or of a map, whatever its command was asked to write there."""

import argparse

import pytest

from wallride.parser import writable, writable_files, writable_map, writable_path, writable_poses


@pytest.fixture(autouse=True)
def files(here):
    for name in ("lab.yaml", "lab.pgm", "lab.png", "lab.walls.csv", "lab.path.csv", "lab.line.csv", "drive.mcap"):
        (here / name).write_text("kept")


def refused(convert, name):
    with pytest.raises(argparse.ArgumentTypeError) as error:
        convert(name)
    return str(error.value)


@pytest.mark.parametrize("convert", [writable, writable_path, writable_files, writable_poses])
@pytest.mark.parametrize("name", ["drive.mcap", "drive.MCAP", "lab.yaml", "lab.pgm", "lab.walls.csv", "lab.path.csv"])
def test_no_recording_and_no_part_of_a_map_is_written_over(convert, name):
    assert refused(convert, name).startswith(f"{name} is the name of a recording or of a map's part")


@pytest.mark.parametrize("name", ["lab.png", "lab.jpg"])
def test_no_other_picture_takes_the_place_of_a_map_s(name):
    assert "a picture of the map beside it" in refused(writable_path, name)
    assert writable("drive.png") == "drive.png"


def test_the_picture_of_a_map_is_not_written_over():
    assert "lab.png, which is a map's picture" in refused(writable_files, "lab.csv")
    assert writable_files("lab.line.csv").name == "lab.line.csv"


def test_poses_do_not_take_the_place_of_a_line():
    assert "name another" in refused(writable_poses, "lab.line.csv")


def test_a_map_is_written_over_a_map():
    assert writable_map("lab.yaml").name == "lab.yaml"


@pytest.mark.parametrize("convert", [writable_path, writable_files, writable_map, writable_poses])
def test_a_file_is_no_standard_output(convert):
    assert refused(convert, "-") == "- is no file; name one"
    assert writable("-") == "-"


def test_a_name_that_is_too_long_is_said():
    assert "File name too long; name another file" in refused(writable, "x" * 300)
