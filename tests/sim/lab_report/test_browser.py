"""The report's page in a real browser, at a desk and on a phone."""

import io

import pytest
from rich.console import Console

from tests.clients.monitor.axe import violations
from wallride.sim.lab.report.drives import Starts
from wallride.sim.lab.report.plan import ReportPlan
from wallride.sim.lab_report.command import measure, write

LOOKS = [{"width": 1400, "height": 900}, {"width": 390, "height": 844, "mobile": True, "dark": True}]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Write a small report once."""
    plan = ReportPlan(
        tests=("t5",), report_settings=("wall_follow.kd=1.6",), law_settings=("wall_follow.kp=13.5",
        "wall_follow.kd=4.5"), starts=Starts(way_m=1.0), trial_speeds_mps=(1.0,), obstacle_speeds_mps=(2.0,),
        varies=False,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("report")
    write(plan, measure(plan, 1, Console(file=io.StringIO())), folder)
    return folder / "report.html"


@pytest.mark.parametrize("look", LOOKS, ids=["desk", "phone"])
async def test_the_page_fits_fetches_nothing_and_is_accessible(tab, page, look):
    await tab.look(**look)
    await tab.go(page.as_uri())
    assert await tab.run("document.querySelectorAll('svg').length") == 5
    assert await tab.run("document.documentElement.scrollWidth <= window.innerWidth")
    assert await tab.run("document.querySelectorAll('svg .line').length") >= 3
    assert set(tab.requests) == {page.as_uri()}
    assert tab.errors == []
    assert await violations(tab) == []
