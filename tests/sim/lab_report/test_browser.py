"""The report's page in a real browser, at a desk and on a phone."""

import pytest

from tests.clients.monitor.axe import violations
from tests.sim.lab_report.conftest import SMALL
from wallride.sim.lab_report.command import write

LOOKS = [{"width": 1400, "height": 900}, {"width": 390, "height": 844, "mobile": True, "dark": True}]


@pytest.fixture(scope="module")
def page(rows, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write(SMALL, rows, folder)
    return folder / "report.html"


@pytest.mark.parametrize("look", LOOKS, ids=["desk", "phone"])
async def test_the_page_fits_fetches_nothing_and_is_accessible(tab, page, look):
    await tab.look(**look)
    await tab.go(page.as_uri())
    assert await tab.run("document.querySelectorAll('svg').length") == 3 * len(SMALL.tests) + 2
    assert await tab.run("document.documentElement.scrollWidth <= window.innerWidth")
    assert await tab.run("document.querySelectorAll('svg .line').length") >= 3
    assert set(tab.requests) == {page.as_uri()}
    assert tab.errors == []
    assert await violations(tab) == []
