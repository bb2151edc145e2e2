"""What `make test` leaves out is there, and is not what stops the car."""

import subprocess
import sys

import pytest

from tests.tiers import SLOW, TESTS, pytest_ignore_collect

ALWAYS = ("drivers", "runtime/arbitration", "runtime/control", "runtime/tasks", "runtime/teleop", "system/soak")


@pytest.mark.parametrize("beginning", SLOW)
def test_what_is_left_out_is_there(beginning):
    folder, _, name = beginning.rpartition("/")
    assert list((TESTS / folder).glob(f"{name}*"))


@pytest.mark.parametrize("folder", ALWAYS)
def test_what_stops_the_car_is_never_left_out(folder, pytestconfig, monkeypatch):
    monkeypatch.setattr(pytestconfig.option, "quick", True)
    assert [path for path in (TESTS / folder).rglob("*") if pytest_ignore_collect(path, pytestconfig)] == []


def test_what_is_slow_in_a_file_is_left_out_by_quick_alone():
    said = {
        options: subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "--collect-only", "-p", "no:cacheprovider", *options,
             "tests/system/test_race_line.py"],
            cwd=TESTS.parent, capture_output=True, text=True, check=True,
        ).stdout
        for options in ((), ("--quick",))
    }  # fmt: skip
    assert "test_laps_are_driven_on_the_line" in said[()]
    assert "test_laps_are_driven_on_the_line" not in said["--quick",]
    assert "test_a_car_whose_lidar_is_covered_stands" in said["--quick",]


def test_make_test_is_quick_and_make_test_all_is_not():
    said = {
        target: subprocess.run(["make", "-n", target], cwd=TESTS.parent, capture_output=True, text=True, check=True)
        for target in ("test", "test-all")
    }
    assert "--quick" in said["test"].stdout
    assert "pytest" in said["test-all"].stdout
    assert "--quick" not in said["test-all"].stdout
