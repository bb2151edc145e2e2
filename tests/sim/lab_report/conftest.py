"""A small report that both the tests of its tables and those in a browser read."""

import io

import pytest
from rich.console import Console

from wallride.sim.lab.report.drives import Starts
from wallride.sim.lab.report.plan import ReportPlan
from wallride.sim.lab_report.command import measure

SMALL = ReportPlan(
    tests=("t2", "t5"), report_settings=("wall_follow.kd=1.6",), law_settings=("wall_follow.kp=13.5",
    "wall_follow.kd=4.5"), starts=Starts(way_m=1.0), trial_speeds_mps=(1.0,), obstacle_speeds_mps=(2.0,), varies=False,
)  # fmt: skip


def driven(jobs):
    return measure(SMALL, jobs, Console(file=io.StringIO()))


@pytest.fixture(scope="session")
def rows():
    return driven(1)
