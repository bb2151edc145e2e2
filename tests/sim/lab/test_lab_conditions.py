"""The lab drives another car than the simulator's own: `--conditions` of what `wallride lab fit` wrote."""

from functools import partial

import pytest

from tests.typed import typed
from wallride.sim.lab import hazards, laps, safety, walls
from wallride.sim.lab.command import chosen, run
from wallride.sim.lab.report import drives
from wallride.sim.lab.report.plan import ReportPlan, first_round, second_round
from wallride.sim.lab.tuning import drive
from wallride.sim.lab.tuning.drive import SCENARIOS
from wallride.sim.lab_report.command import plan_of as report_of
from wallride.sim.lab_report.page import conditions
from wallride.sim.tuning.command import plan_of as study_of

options = partial(typed, "lab")

FITTED = """[vehicle]
steering_delay_s = 0.0450  # 0.045 s (0.040 to 0.050)
trim_rad = 0.0300
[lidar]
noise_std_m = 0.0070
own_parts = "posts"
"""
NAMED = (
    "lidar.noise_std_m=0.007", 'lidar.own_parts="posts"', "vehicle.steering_delay_s=0.045", "vehicle.trim_rad=0.03",
)  # fmt: skip
EXPERIMENTS = {"walls": walls, "safety": safety, "hazards": hazards, "laps": laps}


@pytest.fixture
def fitted(tmp_path):
    file = tmp_path / "fitted.toml"
    file.write_text(FITTED)
    return str(file)


def is_fitted(case):
    car, lidar = case.vehicle, case.lidar
    assert (car.steering_delay_s, car.trim_rad, lidar.noise_std_m) == (0.045, 0.03, 0.007)
    return lidar.own_parts == "posts"


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_run_of_an_experiment_is_of_the_fitted_car(name, fitted, monkeypatch):
    monkeypatch.chdir(fitted.rpartition("/")[0])  # no maps nearby
    choice = chosen(options(name, "--conditions", fitted, "--speeds", "2", "--seeds", "2", "--quick"))
    cells = EXPERIMENTS[name].cells(choice)
    assert {cell.conditions for cell in cells} == {NAMED}
    driven = EXPERIMENTS[name].run(next(cell for cell in cells if "normal" not in cell.scenario))
    assert is_fitted(driven.case)
    assert driven.case.lidar.outlier_share == 0.02, "what the file does not name is the course's own"


def test_the_report_and_its_page_are_of_the_fitted_car(fitted):
    plan = report_of(options("report", "--conditions", fitted, "--condition", "vehicle.grip_mu=0.6"))
    assert (plan.mu, plan.own_parts) == (0.6, "posts")
    runs = [*first_round(plan).values(), *second_round(plan, None).values()]
    assert all(set(NAMED) < set(cell.conditions) for cells in runs for cell in cells)
    assert is_fitted(drives.run(runs[0][0])[0].case)
    said = conditions(plan, "1")
    assert "friction 0.6, 7 mm of noise and no wild beams, 20 ms to the wire, then 45 ms of the servo" in said
    assert "`vehicle.trim_rad=0.03`" in said
    assert "Simulated car" not in conditions(ReportPlan(), "1")


def test_a_study_samples_only_what_the_file_does_not_name(fitted):
    plain = study_of(options("tune"))
    plan = study_of(options("tune", "--conditions", fitted, "--condition", "vehicle.grip_mu=0.7"))
    cells = [cell for seed in range(5) for cell in plan.cells({}, seed, SCENARIOS)]
    assert {(cell.mu, cell.own_parts) for cell in cells} == {(0.7, "posts")}
    assert {cell.side for cell in cells} == {"left", "right"}
    assert is_fitted(drive.run(cells[1]).case)
    assert plan.text() != plain.text(), "a study of another car is another study"
    assert {cell.mu for cell in plain.cells({}, 0, SCENARIOS)} == {0.5, 0.8, 1.0}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--condition", "vehicle.grip_mu=0.6", "--mu", "0.5"], "--mu 0.5: the conditions have vehicle.grip_mu = 0.6"),
        (["--condition", "lidar.own_parts=posts", "--own-parts", "none"], "--own-parts none: the conditions have"),
        (["--condition", "vehicle.grip_mu=9"], "vehicle.grip_mu = 9: input should be less than or equal to 2"),
        (["--condition", "vehicle.wings=2"], "vehicle.wings = 2"),
        (["--conditions", "gone.toml"], "--conditions gone.toml: cannot be read"),
    ],
)
def test_wrong_conditions_are_one_sentence(arguments, words, capsys):
    assert run(options("walls", *arguments)) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_obstacles_are_for_one_drive(tmp_path, capsys):
    file = tmp_path / "with.toml"
    file.write_text('obstacles = ["box at=3,1"]\n')
    assert run(options("walls", "--conditions", str(file))) == 2
    assert "obstacles: are for one drive" in capsys.readouterr().err
