"""`wallride lab report`: its runs, its tables, its pages, and what a wrong option is answered."""

import json
import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.sim.lab_report.conftest import SMALL, driven
from tests.typed import typed
from wallride.runtime.parameters.catalogue import catalogue
from wallride.sim.lab.command import LabUsageError
from wallride.sim.lab.report import drives, published, tables, wall_ahead
from wallride.sim.lab.report.differences import differences
from wallride.sim.lab.report.drives import Starts
from wallride.sim.lab.report.gains import likeness, published_table, trend
from wallride.sim.lab.report.plan import (
    ALONE_LAW,
    REPORT_LAW,
    ReportPlan,
    _scaled,
    distance_kinds,
    first_round,
    obstacles,
    safety_trials,
    trial,
    variations,
)
from wallride.sim.lab_report.command import plan_of, run, write
from wallride.sim.lab_report.page import conditions, document
from wallride.sim.scenario.conditions import ConditionsError

options = partial(typed, "lab", "report")

LAWS = (REPORT_LAW, ALONE_LAW, "ball+swept")
pytestmark = pytest.mark.timeout(240)  # some hundred drives


def test_the_pages_are_the_same_to_the_byte_with_one_and_two_processes(rows, tmp_path):
    for name, some in (("one", rows), ("two", driven(2))):
        write(SMALL, some, tmp_path / name)
    files = {path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*")}
    assert {"report.html", "report.md", "figures.json"} <= {file.name for file in files}
    assert len(files) == 3 + 2 * len(SMALL.tests)
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


def test_the_reports_rule_on_the_reports_errors_gives_its_optima_and_gains():
    table = published_table()
    assert table.optima() == published.OPTIMA
    assert table.average() == published.FINAL == (1.5, 1.6)
    spreads = [published.repeatability_m(test) for test in published.TESTS]
    assert spreads == pytest.approx([0.026, 0.026, 0.036, 0.066, 0.063])
    assert round(published.STOPPED / published.OBSTACLES, 3) == published.EFFECTIVENESS
    assert round(1 - published.STOPPED / published.OBSTACLES, 3) == published.ERROR_RATIO


def test_the_full_plan_is_what_the_report_did():
    plan, runs = ReportPlan(), first_round(ReportPlan())
    for law in (REPORT_LAW, ALONE_LAW):
        assert plan.pairs(law) == {
            "kd": [(2.5, kd) for kd in published.GAINS],
            "kp": [(kp, 1.0) for kp in published.GAINS],
        }
    assert [len(runs[f"gains {law}"]) for law in LAWS] == [60] * 3
    assert all(len(runs[name]) == 60 for name in variations(plan))
    assert [len(runs[f"trials {law}"]) for law in (REPORT_LAW, "ball+swept")] == [25, 25]
    assert all(len(cells) == 28 for name, cells in runs.items() if name.startswith("obstacles"))
    pair = {"wall_follow.kp=2.5", "wall_follow.kd=1"}
    twice = [cell for cell in runs[f"gains {REPORT_LAW}"] if pair < {*cell.settings}]
    assert len(twice) == 2 * len(plan.tests)
    assert len({cell.seed for cell in twice}) == 2, "the pair that stands twice is driven twice"
    assert all(cell.conditions == ("lidar.noise_std_m=0.005", "lidar.outlier_share=0") for cell in twice)


def test_another_law_has_the_pairs_scaled_to_its_own_gains():
    plan = ReportPlan()
    own = plan.settings("ball+swept").wall_follow
    halves = plan.pairs("ball+swept")
    assert halves["kp"][3][0] == pytest.approx(own.kp), "the report's final Kp, 1.5, becomes the law's own"
    assert halves["kd"][2][1] / own.kd == pytest.approx(1.0 / 1.6, abs=1e-3)


def test_a_gain_that_is_set_is_not_varied():
    plan = ReportPlan(report_settings=("wall_follow.kp=1.2",))
    assert plan.pairs(REPORT_LAW) == {"kd": [(1.2, kd) for kd in published.GAINS]}
    assert set(plan.pairs("ball+swept")) == {"kd", "kp"}


def test_each_variation_changes_its_one_condition():
    plan = ReportPlan()
    usual = trial(plan, ALONE_LAW, plan.starts.scenario("t1"))
    for name, one in variations(plan).items():
        changed = one.of(plan)
        cell = trial(changed, ALONE_LAW, changed.starts.scenario("t1"))
        differing = [
            key for key in ("scenario", "speed_mps", "mu", "conditions") if getattr(cell, key) != getattr(usual, key)
        ]
        assert len(differing) == 1, name


def test_settings_friction_and_own_parts_reach_every_run():
    plan = plan_of(
        options(
            "--set", "wall_follow.desired_distance_m=0.8", "--set", "report.wall_follow.kp=1", "--set",
            "law.wall_follow.look_ahead_m=0.5", "--set", "wall_follow.side=right", "--friction", "0.5", "--own-parts",
            "posts", "--wild", "0.02",
        )
    )  # fmt: skip
    for law, own in ((REPORT_LAW, "wall_follow.kp=1"), ("ball+swept", "wall_follow.look_ahead_m=0.5")):
        for cell in (trial(plan, law, "t2"), *obstacles(plan, law, "blind"), *safety_trials(plan, law)):
            assert own in cell.settings
            assert (cell.mu, cell.own_parts, cell.side) == (0.5, "posts", "right")
            assert "lidar.outlier_share=0.02" in cell.conditions
        assert trial(plan, law, "t2").desired_m == 0.8


def one(law, test, pair=None, plan=None):
    plan = plan or ReportPlan(starts=Starts(way_m=2.5))
    return drives.measure(trial(plan, law, plan.starts.scenario(test), pair))


def test_both_errors_are_computed_and_differ_in_the_corner():
    """The report's own distance is half of the range ahead there, and the true one is that to the nearest wall."""
    figures = one(REPORT_LAW, "t5", plan=ReportPlan())
    assert figures["outcome"] == "driven"
    assert abs(figures["law_error_m"] - figures["true_error_m"]) > 0.005


def test_a_gain_and_a_seed_change_the_drive():
    weak, strong = (one(REPORT_LAW, "t2", pair)["law_error_m"] for pair in ((0.5, 1.0), (2.5, 1.0)))
    assert weak != strong
    wild = [ReportPlan(seed=seed, wild=0.1, starts=Starts(way_m=2.5)) for seed in (1, 2)]
    assert len({one(REPORT_LAW, "t2", plan=plan)["law_error_m"] for plan in wild}) == 2


@pytest.mark.parametrize("test", published.TESTS)
@pytest.mark.parametrize("pair", [(0.0, 1.0), (2.5, 0.0), (2.5, 2.5)])
def test_the_reports_law_touches_nothing_at_the_outermost_pairs(test, pair):
    assert one(ALONE_LAW, test, pair, ReportPlan())["outcome"] == "driven"


def table_of(errors, outcome="driven"):
    plan = ReportPlan(tests=("t1",))
    some = [{"law_error_m": error, "outcome": outcome, "test": "t1"} for error in errors]
    return plan, tables.gain_table_of(plan, REPORT_LAW, some)


def test_each_gain_has_its_optimum_in_its_own_half():
    _, table = table_of([0.3, 0.2, 0.1, 0.2, 0.3, 0.4, 0.5, 0.4, 0.3, 0.2, 0.05, 0.3])
    assert table.optima() == {"t1": (2.0, 1.0)}
    _, none = table_of([0.3] * 12, "contact")
    assert none.optima() == {"t1": (None, None)}
    assert none.average() == (None, None)


def test_an_equal_table_is_wholly_alike_and_another_is_not():
    errors = [published.ERRORS_M[half][row, 0] for half in ("kd", "kp") for row in range(6)]
    _, table = table_of(errors)
    assert likeness(table).within == likeness(table).count == 12
    assert likeness(table_of([2 * error for error in errors])[1]).median_ratio == pytest.approx(2.0)
    assert likeness(table_of([0.6] * 12)[1]).within == 0


@pytest.mark.parametrize(
    ("errors_m", "kind", "at"),
    [
        ([0.5, 0.4, 0.3, 0.2, 0.1, 0.05], "falls", 2.5),
        ([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], "rises", 0.0),
        ([0.5, 0.3, 0.1, 0.2, 0.3, 0.4], "least", 1.0),
        ([0.20, 0.21, 0.20, 0.22, 0.21, 0.2], "flat", 0.0),
        ([math.nan, 0.5, 0.3, 0.1, 0.2, 0.3], "least", 1.5),
    ],
)
def test_trends(errors_m, kind, at):
    found = trend(published.GAINS, np.array(errors_m), 0.03)
    assert (found.kind, found.least_at) == (kind, at)


def test_a_trial_is_passed_without_contact_and_failed_with_one():
    plan = ReportPlan()
    cells = {(cell.scenario, cell.speed_mps): cell for cell in safety_trials(plan, REPORT_LAW)}
    assert wall_ahead.measure(cells["2 m", 1.0])["passed"]
    assert not wall_ahead.measure(cells["8 m", 4.0])["passed"], "0.933 m does not stop 4 m/s"


def test_three_distances_are_tried_all_else_equal():
    plan = ReportPlan()
    cells = {kind: distance_kinds(plan, kind)[1] for kind in ("three_smallest", "line", "intercept")}
    errors_m = {kind: drives.measure(cell)["law_error_m"] for kind, cell in cells.items()}
    assert len(set(errors_m.values())) == 3


def test_every_number_of_the_report_stands_in_the_document(rows):
    told = json.loads(json.dumps(document(SMALL, rows)))
    assert told["published"]["errors_m"]["kd"][2] == [0.235, 0.157, 0.142, 0.307, 0.154]
    assert told["published"]["average"] == [1.5, 1.6]
    assert told["trials_passed"][REPORT_LAW][1] == 5
    blind = told["obstacles"][f"{REPORT_LAW} blind"]
    assert blind["effectiveness"] + blind["error_ratio"] == pytest.approx(1.0)
    assert len(blind["stopped"]) == 7
    assert set(told["gain_tables"]) == set(LAWS) - {"ball+swept"}


def as_published(factor=1.0):
    """Rows of a gain table whose errors are the report's, times a factor."""
    return [
        {"law_error_m": factor * error, "true_error_m": error, "outcome": "driven", "test": test, "limit_m": None}
        for half in ("kd", "kp")
        for line in published.ERRORS_M[half]
        for test, error in zip(published.TESTS, line, strict=True)
    ]


def test_what_differs_names_the_report_and_what_was_varied(rows):
    plan = ReportPlan()
    gains = {f"gains {law}": as_published() for law in (REPORT_LAW, ALONE_LAW)}
    varied = {name: as_published(1.0 + number / 10) for number, name in enumerate(variations(plan))}
    said = " ".join(differences(plan, {**rows, **gains, **varied}))
    assert "average optimum here is Kp, Kd 1.5, 1.6 (`report`, safety `report`)" in said
    assert "1.00 times the report's in the median of 60 runs, and 60 differ by no more" in said
    assert "is `friction 0.5` (2.10 times)" in said
    assert "26 of 28" in said
    table = tables.varied(plan, {**gains, **varied})
    assert len(table.rows) == 1 + len(varied)
    assert table.rows[0][-2] == "60 of 60"


def test_a_law_without_a_distance_of_its_own_has_no_error_and_breaks_no_table(rows):
    """`distance_m` of a law is optional."""
    plan = ReportPlan(tests=("t2", "t5"))
    blind = [{**row, "law_error_m": None} for row in rows["ours"]]
    table = tables.final_gains(plan, {**rows, "ours": blind})
    assert table.rows[-2][1:] == ("-", "-", "-")
    assert "-" not in table.rows[-1][1:], "the true error is known all the same"
    (kd, _) = tables.gains(plan, "ball+swept", [{**row, "law_error_m": None} for row in as_published()][:24])
    assert set(kd.rows[0][1:]) == {"-"}


def test_both_gains_set_leave_no_gain_table_and_the_rest_of_the_page(rows):
    plan = replace(SMALL, report_settings=("wall_follow.kp=1.2", "wall_follow.kd=1.6"), varies=True)
    runs = first_round(plan)
    assert not any(name.startswith(("gains", "varied")) for name in runs)
    titles = [table.title for table in tables.all_tables(plan, rows)]
    assert "Trends" not in titles
    assert "Both errors with the final gains" in titles
    assert differences(plan, rows)


def test_errors_of_other_pairs_are_not_set_beside_the_reports():
    plan = ReportPlan(report_settings=("wall_follow.kp=1.2",))
    half = as_published()[:30]
    (table,) = tables.gains(plan, REPORT_LAW, half)
    assert not any("(" in cell for row in table.rows for cell in row[1:])
    final = tables.final_gains(plan, {"report": half[:5]})
    assert final.rows[0][0].startswith("its law with 1.2, 1.6:"), "not the report's pair"
    trends = tables.trends(plan, {f"gains {law}": half for law in (REPORT_LAW, ALONE_LAW)})
    assert {row[-1] for row in trends.rows} == {"-"}
    assert "in 0 of 0" in trends.notes[0]


def test_where_nothing_came_to_its_end_nothing_is_said_of_its_errors(rows):
    plan = ReportPlan()
    stands = [{**row, "outcome": "stands", "last_reason": "obstacle ahead"} for row in as_published()]
    gains = {f"gains {law}": stands for law in (REPORT_LAW, ALONE_LAW)}
    varied = dict.fromkeys(variations(plan), stands)
    said = " ".join(differences(plan, {**rows, **gains, **varied}))
    assert "nan" not in said
    assert "12 stands of 12; last: obstacle ahead" in said
    json.dumps(
        document(SMALL, rows | {"ours": [{**row, "law_error_m": None} for row in rows["ours"]]}), allow_nan=False
    )


def test_a_law_that_never_drives_avoids_nothing():
    plan = ReportPlan(law="ball+swept", law_settings=("wall_follow.kp=13.5",))
    driven = {"clear": True, "stoppable": True, "speed_lost": 0.1, "law": plan.law}
    assert tables.cleared(driven)
    assert not tables.cleared({**driven, "speed_lost": None})
    rows = [{**driven, "speed_lost": None}] * 28
    table = tables.obstacles(plan, plan.law, "follower", rows)
    assert {cell.partition(" ")[0] for row in table.rows for cell in row[1:]} == {"stands"}
    assert table.notes[1].startswith("Effectiveness (share not touched) 0.000")
    assert not wall_ahead.was_driven(plan.law, {"speed_lost": None})
    assert wall_ahead.was_driven(REPORT_LAW, {"speed_lost": None}), "by the letter its turn is a stop"


def test_a_failing_law_is_named_on_the_page(rows):
    law = "wallride.new.pd_follower:PdFollower"
    plan = replace(SMALL, law=f"{law}+swept", law_settings=())
    fault = f"{law} raised ValueError: no"
    some = {f"trials {plan.law}": [{"law_fault": fault}]}
    assert "failed, and the car stood" in differences(plan, {**rows, **some})[0]


def test_a_start_that_touches_the_wall_is_no_fault_of_the_steering():
    plan = ReportPlan(report_settings=("wall_follow.desired_distance_m=0.5",))
    assert one(ALONE_LAW, "t1", plan=plan)["outcome"] == "no room"


def test_scaled_gains_stay_in_their_range_and_stand_once():
    known = catalogue(ReportPlan().settings(REPORT_LAW))["wall_follow.kp"]
    narrow = replace(known, lowest=0.1, highest=1.0)
    assert [_scaled(gain, 0.5, narrow) for gain in (0.0, 0.5, 3.0)] == [0.1, 0.5, 1.0]
    assert 0.1 < _scaled(0.0, 0.5, replace(narrow, open_below=True)) < 0.11
    assert _scaled(0.000123456, 0.5, replace(known, lowest=None)) == 0.0001235
    kp = [pair[0] for pair in ReportPlan(law_settings=("wall_follow.look_ahead_m=0.5",)).pairs("ball+swept")["kp"]]
    assert len(set(kp)) == len(kp)
    assert ReportPlan().pairs("prototype+swept") == {}, "it does not read the gains of ball"


def test_what_is_named_is_not_varied_and_wins_over_nothing_silently():
    plan = ReportPlan(conditions=("lidar.noise_std_m=0.01", "vehicle.grip_mu=0.6"), wild=0.02)
    names = " ".join(variations(plan))
    assert not any(word in names for word in ("noise", "friction", "wild"))
    assert "varied runs of 8 m" in names
    with pytest.raises(ConditionsError, match="leave one of them out"):
        plan_of(options("--wild", "0.1", "--condition", "lidar.outlier_share=0.02"))


def test_settings_of_one_law_are_named_as_such():
    plan = plan_of(options("--set", "report.wall_follow.kp=1", "--set", "wall_follow.speed_mps=1.5"))
    said = conditions(plan, "1")
    assert "`wall_follow.speed_mps=1.5`, `report.wall_follow.kp=1`." in said


def test_the_page_fetches_nothing_and_has_its_figures(rows, tmp_path):
    write(SMALL, rows, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)\s*=|url\(|@import|<script""", page)
    assert page.count("<svg") == 3 * len(SMALL.tests) + 2
    markdown = (tmp_path / "report.md").read_text()
    named = re.findall(r"\]\((figures/[^)]+)\)", markdown)
    assert len(named) == 2 * len(SMALL.tests)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in named)
    for words in ("Effectiveness", "Passed 5 of 5", "turn radius", "own error", "true error"):
        assert words in page


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
        (["--wild", "2"], "0 to 0.5"),
        (["--own-parts", "wings"], "write one of"),
    ],
)
def test_wrong_options_say_what_to_write(arguments, words):
    with pytest.raises(LabUsageError, match=re.escape(words)):
        plan_of(options(*arguments))


def test_an_output_that_cannot_be_is_noticed_before_driving(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert run(options("-o", str(tmp_path / "file"))) == 2
    assert run(options("-o", str(tmp_path / "no" / "folder"))) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_ctrl_c_writes_nothing(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("wallride.sim.lab_report.command.measure_all", interrupted)
    assert run(options("-o", str(tmp_path / "out"))) == 130
    assert not (tmp_path / "out").exists()
