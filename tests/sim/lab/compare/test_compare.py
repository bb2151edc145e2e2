"""`lab compare`: a planted change is told from noise, and no change is none."""

import json
import math
from functools import partial

import numpy as np
import pytest

from tests.typed import typed
from wallride.sim.lab.compare.command import run
from wallride.sim.lab.compare.pairs import ComparisonError, pairs_of
from wallride.sim.lab.compare.statistics import paired_difference
from wallride.sim.lab.sweep.table import TableRun

options = partial(typed, "lab", "compare")

REPETITIONS = 20
PAIRS = 60


def noisy_errors(random, change):
    """Return mean errors of 60 drives and of the same ones with other noise and a change: each spreads by 5 %."""
    true_m = random.uniform(0.05, 0.3, PAIRS)
    noise = random.lognormal(0.0, 0.05, (2, PAIRS))
    return true_m * noise[0], true_m * noise[1] * (1 + change)


def told(change, seed):
    results = []
    for repetition in range(REPETITIONS):
        a, b = noisy_errors(np.random.default_rng([seed, repetition]), change)
        results.append(paired_difference(a, b))
    return results


def test_a_planted_change_of_5_percent_is_told_from_noise():
    results = told(0.05, seed=1)
    assert sum(result.is_told and result.difference > 0 for result in results) == REPETITIONS
    assert sum(result.is_told and result.difference < 0 for result in told(-0.05, seed=4)) >= REPETITIONS - 1
    assert all(result.low < result.difference < result.high for result in results)


def test_no_change_is_no_difference():
    assert sum(result.is_told for result in told(0.0, seed=2)) <= 1


def test_rare_and_skewed_figures_keep_the_level_too():
    random = np.random.default_rng(3)
    contacts = [paired_difference(*(random.random((2, 60)) < 0.1).astype(float)).is_told for _ in range(100)]
    skewed = [paired_difference(*np.exp(random.normal(size=(2, 30)))).is_told for _ in range(100)]
    assert sum(contacts) <= 4
    assert sum(skewed) <= 4


def test_the_same_runs_and_too_few_runs_say_nothing():
    same = paired_difference(np.ones(20), np.ones(20))
    assert (same.difference, same.low, same.high, same.is_told) == (0.0, 0.0, 0.0, False)
    few = paired_difference(np.zeros(7), np.ones(7))
    assert math.isnan(few.low)
    assert not few.is_told
    assert paired_difference(np.zeros(8), np.ones(8)).is_told
    assert not paired_difference(np.array([]), np.array([])).is_told


def run_of(error="", figures=None, **values):
    return TableRun(values, figures or {"mean_error_m": 0.1}, error)


def test_pairs_agree_in_all_but_what_is_compared():
    a = [run_of(law="ball", seed=seed, mu=0.8) for seed in range(4)]
    b = [run_of(law="report", seed=seed, mu=0.8) for seed in (3, 1, 2)] + [
        run_of("broke", law="report", seed=0, mu=0.8)
    ]
    pairs = pairs_of(a, b)
    assert pairs.compared == (("law", "ball", "report"),)
    assert [one.values["seed"] for one in pairs.a] == [one.values["seed"] for one in pairs.b] == [1, 2, 3]
    assert (pairs.failed, pairs.alone) == (1, 0)
    more = pairs_of([*a, run_of(law="ball", seed=9, mu=0.8)], b)
    assert more.alone == 1


def test_figures_that_one_side_does_not_have_are_left_out_pair_by_pair():
    a = [run_of(law="ball", seed=seed, figures={"lap_s": 9.0 + seed, "why": "x"}) for seed in range(3)]
    b = [run_of(law="report", seed=seed, figures={"lap_s": None if seed else 8.0, "why": "x"}) for seed in range(3)]
    pairs = pairs_of(a, b)
    assert pairs.figure_names() == ["lap_s"]
    assert [list(side) for side in pairs.figures("lap_s")] == [[9.0], [8.0]]


@pytest.mark.parametrize(
    ("a", "b", "words"),
    [
        ([{"law": "x", "seed": 1}], [{"law": "y", "seed": 2}, {"law": "y", "seed": 3}], "several of it"),
        ([{"seed": 1, "mu": 1}, {"seed": 2, "mu": 2}], [{"seed": 1, "mu": 2}, {"seed": 2, "mu": 1}], "no pair of runs"),
    ],
)
def test_sides_that_do_not_fit_are_told(a, b, words):
    with pytest.raises(ComparisonError, match=words):
        pairs_of([run_of(**values) for values in a], [run_of(**values) for values in b])


SWEEP = """world = "straight"
duration_s = 0.5
[grid]
law = ["ball", "report"]
[random]
runs = 8
start.toward_deg = { from = -15, to = 15 }
"""


def test_a_sweep_is_run_and_its_parts_are_compared(tmp_path, capsys):
    file = tmp_path / "laws.toml"
    file.write_text(SWEEP)
    assert run(options(f"{file}:law=ball", f"{file}:law=ball", "--jobs", 1)) == 0
    same = capsys.readouterr().out
    assert "the same runs" in same
    assert "no difference" in same
    assert "higher" not in same
    table = file.with_suffix(".sqlite")
    assert run(options(f"{table}:law=ball", f"{table}:law=report", "--figures", "mean_error_m", "--json", "-")) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["compared"] == [["law", "ball", "report"]]
    assert summary["figures"]["mean_error_m"]["pairs"] == 8


def test_settings_files_are_compared_in_the_drives_of_a_sweep(tmp_path, capsys):
    sweep = tmp_path / "drives.toml"
    sweep.write_text(
        'world = "straight"\nduration_s = 1.0\n[random]\nruns = 8\nstart.toward_deg = { from = -9, to = 9 }\n'
    )
    for name, speed_mps in (("slow", 1.0), ("fast", 2.0)):
        (tmp_path / f"{name}.toml").write_text(f"[wall_follow]\nspeed_mps = {speed_mps}\n")
    sides = [tmp_path / "slow.toml", tmp_path / "fast.toml"]
    assert run(options(*sides)) == 2
    assert "--sweep FILE" in capsys.readouterr().err
    assert run(options(*sides, "--sweep", sweep, "--jobs", 1, "--json", "-", "--figures", "distance_m")) == 0
    assert "higher" in json.loads(capsys.readouterr().out)["figures"]["distance_m"]["says"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["gone.sqlite", "gone.sqlite"], "no such file"),
        (["{file}", "{file}", "--confidence", "2"], "give 0.5 to 0.999"),
        (["{file}:law=bull", "{file}"], "no run has law = bull"),
        (["{file}:law=ball", "{file}:law=report", "--figures", "speed"], "there are duration_s"),
    ],
)
def test_mistakes_are_told(tmp_path, capsys, arguments, words):
    file = tmp_path / "laws.toml"
    file.write_text(SWEEP.replace("runs = 8", "runs = 2"))
    assert run(options(*(argument.format(file=file) for argument in arguments))) == 2
    assert words in capsys.readouterr().err
