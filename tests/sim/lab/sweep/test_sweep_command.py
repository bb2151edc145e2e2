"""`wallride lab sweep`: each run once, whatever happens in between."""

import json
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from tests.own_laws import HEAD, INIT
from tests.typed import typed
from wallride.sim.lab.sweep.command import run
from wallride.sim.lab.sweep.table import open_table

options = partial(typed, "lab", "sweep")

SHORT = """world = "straight"
duration_s = 0.5
[random]
runs = {runs}
vehicle.grip_mu = {{ from = 0.5, to = 1.0 }}
"""


@pytest.fixture
def sweep_file(tmp_path):
    def write(runs=12, more=""):
        file = tmp_path / "some.toml"
        file.write_text(more + SHORT.format(runs=runs))
        return file

    return write


def ends_of(table):
    """Return when each run of a table ended, by the run's key."""
    with closing(sqlite3.connect(table)) as connection:
        return dict(connection.execute("SELECT cell_key, ended_unix_s FROM runs").fetchall())


def test_one_process_and_two_give_the_same_rows(sweep_file, tmp_path):
    file = sweep_file(more='obstacles = ["box ahead=0.5 after=0.2"]\n')
    for jobs in ("1", "2"):
        outputs = ["--json", tmp_path / f"{jobs}.json", "--csv", tmp_path / f"{jobs}.csv"]
        assert run(options(file, "--jobs", jobs, "--table", tmp_path / f"{jobs}.sqlite", *outputs)) == 0
    assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()
    assert (tmp_path / "1.csv").read_bytes() == (tmp_path / "2.csv").read_bytes()
    rows = json.loads((tmp_path / "1.json").read_text())
    assert [row["seed"] for row in rows] == list(range(12))
    assert {"vehicle.grip_mu", "mean_error_m", "collided", "error"} <= set(rows[0])
    assert len((tmp_path / "1.csv").read_text().splitlines()) == 13


def test_what_is_there_is_not_run_again_and_more_runs_are_added(sweep_file, capsys):
    file = sweep_file(6)
    assert run(options(file, "--jobs", 1)) == 0
    assert "6 made" in capsys.readouterr().out
    before = ends_of(file.with_suffix(".sqlite"))
    sweep_file(8)
    assert run(options(file, "--jobs", 1)) == 0
    assert "2 made" in (said := capsys.readouterr().out)
    assert "6 were there" in said
    after = ends_of(file.with_suffix(".sqlite"))
    assert len(after) == 8
    assert before.items() <= after.items()


@pytest.mark.timeout(120)
def test_killed_in_the_middle_it_loses_nothing_and_repeats_nothing(sweep_file):
    file = sweep_file(60)
    table = file.with_suffix(".sqlite")
    command = [sys.executable, "-m", "wallride", "lab", "sweep", str(file), "--jobs", "2"]
    first = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until_s = time.monotonic() + 60
        while not (table.exists() and table.stat().st_size and _count(table) >= 5):
            assert first.poll() is None
            assert time.monotonic() < until_s
            time.sleep(0.005)
    finally:
        first.send_signal(signal.SIGKILL)
        first.wait()
    before = ends_of(table)
    assert 5 <= len(before) < 60
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"{60 - len(before)} made" in again.stdout
    after = ends_of(table)
    assert len(after) == 60
    assert before.items() <= after.items()


def _count(table):
    try:
        return len(ends_of(table))
    except sqlite3.OperationalError:
        return 0


SOMETIMES = INIT + (
    "def follow(self, scan, state):\n"
    "    if state.desired_speed_mps > 1.5: 1 / zero_22.ZERO\n"
    "    return Guidance(1.0, 0.0, 1.0)\n"
)


def test_a_failing_run_is_a_row_and_can_be_run_again(law_file, tmp_path, capsys):
    zero = tmp_path / "zero_22.py"
    zero.write_text("ZERO = 0\n")
    law = law_file(SOMETIMES, head=f"{HEAD}import zero_22\n")
    file = tmp_path / "law.toml"
    file.write_text(
        f'world = "straight"\nduration_s = 0.5\nlaw = "{law}"\n[grid]\nwall_follow.speed_mps = [1.0, 2.0]\n'
    )
    for again, made in (([], "2 made"), ([], "0 made"), (["--again-failed"], "1 made")):
        assert run(options(file, "--jobs", 1, *again)) == 1
        assert made in (said := capsys.readouterr().out)
        assert "1 failed" in said
    with open_table(file.with_suffix(".sqlite"), writes=False) as table:
        good, bad = sorted(table.runs(), key=lambda one: one.values["wall_follow.speed_mps"])
    assert good.error == ""
    assert good.figures["distance_m"] > 0
    assert f"LawError: {law} raised ZeroDivisionError" in bad.error
    zero.write_text("ZERO = 1\n")
    mended = subprocess.run(
        [sys.executable, "-m", "wallride", "lab", "sweep", str(file), "--jobs", "1"], cwd=tmp_path, text=True,
        capture_output=True, check=True, env={"PYTHONPATH": str(Path(__file__).parents[4]), "PATH": ""},
    )  # fmt: skip
    assert "2 made" in mended.stdout


@pytest.mark.parametrize("arguments", [["--csv", "no/such/file.csv"], ["--table", "no/such/file.sqlite"]])
def test_outputs_are_checked_before_minutes_of_driving(sweep_file, capsys, arguments):
    with pytest.raises(SystemExit):
        options(sweep_file(), *arguments)
    assert "there is no directory no/such; make it first" in capsys.readouterr().err


def test_a_file_that_is_no_table_is_refused(sweep_file, capsys):
    assert run(options(sweep_file(), "--table", __file__)) == 2
    assert "is not a table of runs" in capsys.readouterr().err


def test_a_mistake_in_the_file_is_told_before_anything_is_run(sweep_file, capsys):
    file = sweep_file(more="wall_follow.kpp = 3\n")
    assert run(options(file)) == 2
    assert f"{file}:1: wall_follow.kpp is not a setting; did you mean wall_follow.kp?" in capsys.readouterr().err


def test_two_commands_do_not_fill_one_table(sweep_file, capsys):
    file = sweep_file()
    with open_table(file.with_suffix(".sqlite"), writes=True):
        assert run(options(file)) == 2
    assert "another command is filling it" in capsys.readouterr().err
