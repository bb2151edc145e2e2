"""The first `make sim` installs for over a minute: it says so before, and shows its packages while it does."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINE = "build/race/lap.line.csv"
# `make test ARGS=...` hands its own options down to each make that a test starts.
BARE = {name: text for name, text in os.environ.items() if name not in ("MAKEFLAGS", "MAKEOVERRIDES", "ARGS")}


def test_the_set_up_is_announced_and_not_silent():
    told = subprocess.run(
        ["make", "-n", "-B", ".venv/.ready"], cwd=ROOT, env=BARE, capture_output=True, text=True, check=True
    ).stdout.splitlines()  # fmt: skip
    says = [number for number, line in enumerate(told) if line.startswith('echo "wallride: ')]
    (packages,) = (number for number, line in enumerate(told) if "-e '.[dev]'" in line)
    assert says[0] < packages
    assert "about a minute and a half" in told[says[0]]
    assert "--quiet" not in told[packages], "pip names each package as it comes"


def test_what_the_two_commands_do_once_all_is_set_up():
    done = [word for name in ("ready", "kernel", "bytecode") for word in ("-o", f".venv/.{name}")]
    done += ["-o", LINE]
    recipes = {
        goal: subprocess.run(
            ["make", "--no-print-directory", "-n", *done, goal],
            cwd=ROOT, env=BARE, capture_output=True, text=True, check=True,
        ).stdout.splitlines()
        for goal in ("sim", "race", "test", "check")
    }  # fmt: skip
    assert recipes["sim"] == [".venv/bin/wallride sim "]
    assert recipes["race"] == [".venv/bin/wallride sim --race build/race/lap.yaml --laps 10 "]
    assert recipes["test"][0].startswith(".venv/bin/pytest -q -rfER -n 4 --dist worksteal --quick  || {")
    assert recipes["check"][0] == ".venv/bin/ruff format --check ."


@pytest.mark.parametrize(
    ("codes", "calls", "fails"), [([0], 1, False), ([1, 0], 2, False), ([1, 1], 2, True), ([2], 1, True)]
)
def test_what_failed_among_others_runs_once_more_alone(tmp_path, codes, calls, fails):
    """A `pytest` that ends with these codes: only failed tests are run again, and their second end counts."""
    (fake := tmp_path / "pytest").write_text(
        f'#!/bin/sh\necho "$@" >> {tmp_path}/calls\nset -- {" ".join(map(str, codes))}\n'
        f"shift $(($(wc -l < {tmp_path}/calls) - 1))\nexit $1\n"
    )
    fake.chmod(0o755)
    done = [word for name in ("ready", "kernel", "bytecode") for word in ("-o", f".venv/.{name}")]
    ended = subprocess.run(["make", "-s", *done, f"BIN={tmp_path}", "test"], cwd=ROOT, env=BARE, check=False)
    called = (tmp_path / "calls").read_text().splitlines()
    assert (len(called), ended.returncode != 0) == (calls, fails)
    assert ["--last-failed" in line for line in called] == [False, True][:calls]
    assert all("--quick" in line for line in called)
    assert "-n 4" in called[0]
    assert not any("-n" in line.split() for line in called[1:])


def test_a_race_drives_and_maps_a_lap_first_and_only_once(tmp_path):
    for made, steps in (False, ["sim", "map", "line"]), (True, []):
        if made:
            (tmp_path / "lap.line.csv").touch()
        told = subprocess.run(
            ["make", "-n", "-o", ".venv/.kernel", f"RACE={tmp_path}", f"{tmp_path}/lap.line.csv"],
            cwd=ROOT, env=BARE, capture_output=True, text=True, check=True,
        ).stdout.splitlines()  # fmt: skip
        assert [line.split()[1] for line in told if line.startswith(".venv/bin/wallride ")] == steps
