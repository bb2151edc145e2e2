"""`wallride lab report`: its runs, its tables, its pages, and what a wrong option is answered."""

import argparse
import io
import json
import re

import pytest
from rich.console import Console

from sim.lab.report import tables, trials
from sim.lab.report.differences import _noise, differences
from sim.lab.report.plan import (
    ALONE_LAW,
    CLEAN_TABLE,
    GRID_KD,
    GRID_KP,
    REPORT_LAW,
    ReportPlan,
    first_round,
    obstacles,
    trial,
)
from sim.lab.safety import DISTANCES_M
from sim.lab_report.command import ReportUsageError, measure, plan_of, run, write
from wallride import lab_options

SMALL = ReportPlan(
    tests=("t1", "t2"), speeds_mps=(2.0,), report_settings=("wall_follow.kd=1.6",),
    law_settings=("wall_follow.kp=13.5", "wall_follow.kd=4.5"),
)  # fmt: skip
LAWS = (ALONE_LAW, REPORT_LAW, "ball+swept")


def options(*arguments):
    parser = argparse.ArgumentParser()
    lab_options.add(parser)
    return parser.parse_args(["report", *arguments])


def driven(jobs):
    return measure(SMALL, jobs, Console(file=io.StringIO()))


@pytest.fixture(scope="module")
def rows():
    return driven(1)


def test_the_pages_are_the_same_to_the_byte_with_one_and_two_processes(rows, tmp_path):
    for name, some in (("one", rows), ("two", driven(2))):
        write(SMALL, some, tmp_path / name)
    files = {path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*")}
    assert {"report.html", "report.md", "figures.json"} <= {file.name for file in files}
    assert len(files) == 3 + 2 * len(SMALL.tests)
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


def test_another_seed_gives_other_figures(rows):
    one = trial(SMALL, REPORT_LAW, "t2")
    other = trial(ReportPlan(seed=SMALL.seed + 1), REPORT_LAW, "t2")
    assert trials.measure(one)["mean_error_m"] != trials.measure(other)["mean_error_m"]


def test_the_full_plan_is_what_the_report_did():
    plan = ReportPlan()
    runs = first_round(plan)
    for law in LAWS:
        assert len(plan.pairs(law)) == 12
    assert [len(cells) for name, cells in runs.items() if name.startswith("gains")] == [12 * 5] * 4
    assert (1.5, 1.6) in plan.pairs(REPORT_LAW)
    assert all(len(cells) == 28 for name, cells in runs.items() if name.startswith("obstacles"))
    assert {cell.settings[0] for cell in runs[f"gains {REPORT_LAW}"]} == {f"wall_follow.kp={kp:g}" for kp in GRID_KP}
    assert all(abs(course.toward_rad) == pytest.approx(0.5236, abs=1e-4) for course in list(trials.TESTS.values())[:4])


def test_a_gain_that_is_set_is_not_varied():
    plan = ReportPlan(report_settings=("wall_follow.kp=1.2",))
    assert plan.pairs(REPORT_LAW) == [(1.2, kd) for kd in GRID_KD]
    assert len(plan.pairs("ball+swept")) == 12


def test_settings_friction_and_own_parts_reach_every_run():
    plan = plan_of(
        options(
            "--set", "wall_follow.desired_distance_m=0.8", "--set", "report.wall_follow.kp=1", "--set",
            "law.wall_follow.look_ahead_m=0.5", "--set", "wall_follow.side=right", "--friction", "0.5", "--own-parts",
            "posts",
        )
    )  # fmt: skip
    for law, own in ((REPORT_LAW, "wall_follow.kp=1"), ("ball+swept", "wall_follow.look_ahead_m=0.5")):
        for cell in (trial(plan, law, "t2", (2.0, 2.0)), *obstacles(plan, law, "blind")):
            assert own in cell.settings
            assert (cell.mu, cell.own_parts, cell.side) == (0.5, "posts", "right")
        assert trial(plan, law, "t2").desired_m == 0.8


def test_a_gain_changes_the_drive():
    weak, strong = (trials.measure(trial(ReportPlan(), REPORT_LAW, "t2", pair)) for pair in ((0.5, 0.8), (2.0, 2.4)))
    assert weak["mean_error_m"] != strong["mean_error_m"]


def figures(test, error_m, outcome="driven"):
    limit = {"limit_m": 0.05, "limit_known": True}
    return {"test": test, "mean_error_m": error_m, "outcome": outcome, "settle_s": 1.0, "duration_s": 8.5, **limit}


def test_the_optimum_is_the_least_error_of_a_run_that_ended_well():
    plan = ReportPlan(tests=("t1", "t2"), report_settings=("wall_follow.kd=1.6",))
    of_t1 = [figures("t1", 0.01, "contact"), *(figures("t1", error_m) for error_m in (0.3, 0.2, 0.4))]
    of_t2 = [figures("t2", error_m) for error_m in (0.2, 0.4, 0.3, 0.1)]
    rows = [row for pair in zip(of_t1, of_t2, strict=True) for row in pair]
    best = tables.optima(plan, REPORT_LAW, rows)
    assert best == {"t1": (1.5, 1.6), "t2": (2.0, 1.6)}
    assert tables.averaged(best) == (1.75, 1.6)
    table = tables.gains(plan, REPORT_LAW, rows)
    assert table.rows[0][1] == "X"
    assert table.rows[2][1].endswith(tables.OPTIMUM)
    assert table.rows[2][0].startswith("1.5,\u00a01.6 (the report)")
    assert table.rows[-1][-1] == "1.75,\u00a01.6"


def test_a_law_that_stands_is_no_contact(rows):
    """The report's safety sees the wall at 0.73 m from t1's start, and its stop is fixed at 0.933 m."""
    of_t1 = [row for row in rows[f"gains {REPORT_LAW}"] if row["test"] == "t1"]
    assert {row["outcome"] for row in of_t1} == {"stands"}
    assert all(not row["collided"] for row in of_t1)
    said = " ".join(differences(SMALL, rows))
    assert "t1 (close, toward the wall) with the report's safety: stands with every pair" in said


def test_noise_is_named_where_it_is_the_cause():
    """The report's pair gets round t1 at 0.5 m with a perfect lidar, and touches the wall with a noisy one."""
    for name, outcome in (("t1 clean", "driven"), ("t1", "contact")):
        assert trials.measure(trial(ReportPlan(), ALONE_LAW, name, (1.5, 1.6)))["outcome"] == outcome
    plan = ReportPlan(tests=("t1",))
    rows = {
        f"gains {name}": [figures("t1", 0.2, outcome) for _ in plan.pairs(ALONE_LAW)]
        for name, outcome in ((CLEAN_TABLE, "driven"), (ALONE_LAW, "contact"))
    }
    (said,) = _noise(plan, rows)
    assert "drives t1 to the end with a lidar without noise, and nothing with 20 mm" in said


def test_what_differs_names_the_obstacles_of_the_report(rows):
    counted = [row for row in rows[f"obstacles {REPORT_LAW} blind"] if row["clear"]]
    said = [one for one in differences(SMALL, rows) if "26 of 28" in one]
    assert len(said) == 1
    assert f"its law here in {len(counted)} of {len(DISTANCES_M)}" in said[0]


def test_every_table_stands_beside_the_report_and_physics(rows):
    made = tables.all_tables(SMALL, rows)
    text = json.dumps([(table.title, table.columns, table.rows, table.notes) for table in made])
    for words in ("physics: least of any steering", "not in the references", "physics allows", "0.9329"):
        assert words in text
    assert all(table.notes for table in made)


def test_the_page_fetches_nothing(rows, tmp_path):
    write(SMALL, rows, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)\s*=|url\(|@import|<script""", page)
    assert page.count("<svg") == 3 * len(SMALL.tests)
    markdown = (tmp_path / "report.md").read_text()
    named = re.findall(r"\]\((figures/[^)]+)\)", markdown)
    assert len(named) == 2 * len(SMALL.tests)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in named)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--method", "magic"], "no law is called"),
        (["--method", "report"], "other than report"),
        (["--set", "wall_follow.kpp=1"], "kpp is not a setting"),
        (["--set", "wall_follow.look_ahead_m=0.5"], "law.KEY=VALUE"),
        (["--set", "wall_follow.method=ball"], "use --method"),
        (["--set", "report.wall_follow.side=right"], "one side"),
        (["--friction", "9"], "0.1 to 2"),
        (["--own-parts", "wings"], "write one of"),
        (["--jobs", "0"], "1 or more"),
    ],
)
def test_wrong_options_say_what_to_write(arguments, words):
    with pytest.raises(ReportUsageError, match=re.escape(words)):
        plan_of(options(*arguments))


def test_an_output_that_cannot_be_is_noticed_before_driving(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert run(options("-o", str(tmp_path / "file"))) == 2
    assert run(options("-o", str(tmp_path / "no" / "folder"))) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_ctrl_c_writes_nothing(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("sim.lab_report.command.measure_all", interrupted)
    assert run(options("-o", str(tmp_path / "out"))) == 130
    assert not (tmp_path / "out").exists()
