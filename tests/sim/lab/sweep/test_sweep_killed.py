"""One process, two with one killed half-way, two Ray nodes with one killed half-way: the same rows, each once.

The 2,000 runs of docs/scale.md: python -m tests.sim.lab.sweep.killed_halfway FILE TABLE nodes
"""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.typed import typed
from wallride.sim.lab.sweep.command import run

ROOT = Path(__file__).parents[4]
SWEEP = """world = "straight"
duration_s = 1.0
law = "report"
[random]
runs = 24
vehicle.grip_mu = { from = 0.5, to = 1.0 }
"""
WITH_RAY = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: pip install 'wallride[cluster]'")


def exported(file, table, to):
    """Return the rows of a full table as JSON; nothing is run again."""
    assert run(typed("lab", "sweep", file, "--table", table, "--jobs", "1", "--json", to)) == 0
    return to.read_bytes()


@pytest.mark.timeout(240)
@pytest.mark.parametrize("what", ["processes", pytest.param("nodes", marks=WITH_RAY)])
def test_what_is_killed_half_way_changes_no_row(tmp_path, what, capsys):
    file, table = tmp_path / "some.toml", tmp_path / "killed.sqlite"
    file.write_text(SWEEP)
    done = subprocess.run(
        [sys.executable, "-m", "tests.sim.lab.sweep.killed_halfway", file, table, what],
        cwd=ROOT, capture_output=True, text=True, check=True, timeout=220,
    )  # fmt: skip
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["code"] == 0
    assert 12 <= said["killed_at"][0] < 24
    rows = exported(file, table, tmp_path / "killed.json")
    assert "0 made" in capsys.readouterr().out
    assert rows == exported(file, tmp_path / "one.sqlite", tmp_path / "one.json")
    assert len({row["vehicle.grip_mu"] for row in json.loads(rows)}) == 24
