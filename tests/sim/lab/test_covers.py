"""A few cells of `wallride lab covers`: no contact that a brake avoids; and the experiment notices one."""

from dataclasses import dataclass

import numpy as np
import pytest

from wallride.runtime.control.report.laws import ReportGuard
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab import covers, hazards, laws
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.covers import Cover
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.beams import NO_RETURN_MM


def cell(scenario, speed_mps=2.0, law="ball+swept", side="left"):
    return Cell("covers", scenario, law, speed_mps, 0.8, side, 31)


@pytest.mark.parametrize("scenario", [
    "30 mm: 45 deg: driving: dead end",
    "140 mm: 90 deg: driving: loop",
    "160 mm: 60 deg: driving: wall",
    "silent: 30 deg: driving: dead end",
    "silent: 45 deg: driving: person stands",
    "silent: 119 deg: driving: person steps in",
])  # fmt: skip
def test_a_cover_while_driving_ends_in_no_contact_that_a_brake_avoids(scenario):
    for speed_mps, side in ((1.0, "left"), (4.0, "right")):
        figures = covers.measure(cell(scenario, speed_mps, side=side))
        assert not figures["avoidable"]
        assert figures["stands"]


@pytest.mark.parametrize("cover", ["3 mm", "170 mm", "silent"])
def test_a_car_that_is_covered_from_the_start_comes_no_farther_than_a_crawl(cover):
    for width_deg in (30, 60, 135):
        figures = covers.measure(cell(f"{cover}: {width_deg} deg: from the start: person stands"))
        assert not figures["collided"]
        assert figures["way_after_m"] < 0.8


@pytest.mark.parametrize("scenario", [
    "30 mm: 45 deg: driving: dead end",
    "85 mm: 60 deg: driving: dead end",
    "silent: 30 deg: driving: dead end",
    "silent: 60 deg: from the start: person stands",
])  # fmt: skip
def test_under_the_reports_law_the_cars_own_guards_stop_a_covered_car(scenario):
    figures = covers.measure(cell(scenario, 1.0, law="ball+report"))
    assert not figures["avoidable"]
    assert figures["stands"]


def test_a_car_that_is_blind_to_its_cover_has_a_contact_too_many(monkeypatch):
    blind = ReportGuard(CarSettings())
    monkeypatch.setattr(covers, "run", lambda cell: laws.drive_case(cell, covers.case_of(cell), guard=blind))
    assert covers.measure(cell("85 mm: 60 deg: driving: dead end"))["avoidable"]


def test_a_cover_reads_what_it_should_from_its_moment_on():
    reported_mm = np.full(1081, 5000)
    for reads_mm in (100, None):
        cover = Cover(reads_mm, 45.0, 2.0, seed=1)
        assert (cover(reported_mm, 1.9) == 5000).all()
        covered = cover(reported_mm, 2.0) != 5000
        assert not covered[:360].any()
        assert not covered[721:].any()
        assert covered.sum() > 340
        there = cover(reported_mm, 2.0)[covered]
        assert (there == NO_RETURN_MM).all() if reads_mm is None else np.abs(np.median(there) - 100) < 2


def test_the_plan_has_every_cover_and_the_table_counts():
    choice = CellChoice(("ball+swept",), (1.0,), (0.8,), ("left",), (0,))
    assert len(covers.cells(choice)) == 10 * 7 * 2 * 5
    made = cell("30 mm: 10 deg: driving: dead end", 1.0)
    (table,) = covers.tables([made.named(covers.measure(made))])
    assert table.rows[0][0] == "30 mm, driving"
    assert "0 of 1 runs" in table.notes[0]


@dataclass(frozen=True)
class RightHalfSilent:
    """Cover of every beam to the right of ahead; two beams in a hundred remain outliers."""

    seed: int = 41

    def __call__(self, reported_mm, now_s):
        """Return the covered ranges."""
        random = np.random.default_rng((self.seed, round(1000 * now_s)))
        silent = np.linspace(-135, 135, reported_mm.size) <= 0
        return np.where(silent & (random.random(reported_mm.size) >= 0.02), NO_RETURN_MM, reported_mm)


def test_half_a_lidar_that_is_silent_from_the_start_proves_no_depth():
    case = Case(
        world_of("dead_end", "left"), start_speed_mps=0.0, duration_s=12.0, standing_s=3.0, seed=41,
        vehicle=VehicleSettings(grip_mu=0.8), cover=RightHalfSilent(),
    )  # fmt: skip
    run = drive(case, *laws.build("ball", "left", 1.0, 3.0))
    assert run.contact is None
    assert run.reasons[-1] == "the lidar is blind ahead: uncover it"


def test_a_car_that_slides_through_a_bend_and_back_is_not_blind():
    made = Cell("hazards", "normal t5", "ball+swept", 4.0, 0.5, "left", 9100)
    assert not hazards.measure(made)["needless_stop"]
