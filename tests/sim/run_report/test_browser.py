"""The report in a real browser: the cursor, zoom and playback, at a desk and on a phone."""

import json
from dataclasses import replace

import pytest

from tests.clients.monitor.axe import violations
from wallride.sim.run_report.page import page
from wallride.sim.run_report.shown import shown

CURSOR = "document.querySelector('svg[data-chart=speed] .cursor').getAttribute('d')"
CLOCK = "Number.parseFloat(document.querySelector('.clock').textContent)"
WHY = "document.querySelectorAll('.scene dd')[1].textContent"
TICKS = "[...document.querySelectorAll('svg[data-chart=speed] .col')].map((e) => Number(e.textContent))"
LOOKS = [{"width": 1400, "height": 900}, {"width": 390, "height": 844, "mobile": True, "dark": True}]


async def opened(tab, tmp_path, *runs, look=0):
    file = tmp_path / "run.html"
    file.write_text(page(*runs), encoding="utf-8")
    await tab.look(**LOOKS[look])
    await tab.go(file.as_uri())
    await tab.until("document.body.classList.contains('live')")
    return file


async def test_the_cursor_moves_in_all_plots_and_tells_the_decision(run, tab, tmp_path):
    one = shown(run)
    file = await opened(tab, tmp_path, one)
    cursors = "[...document.querySelectorAll('svg[data-chart] .cursor')].map((e) => e.getAttribute('d').split(' ')[0])"
    before = await tab.run(cursors)
    x, y = await tab.middle("svg[data-chart=speed]")
    await tab.mouse("mousePressed", x, y)
    await tab.mouse("mouseMoved", x + 40, y)
    await tab.mouse("mouseReleased", x + 40, y)
    after = await tab.run(cursors)
    assert len(after) >= 3
    assert len(set(after)) == 1
    assert after != before
    assert await tab.run(CLOCK) > run.duration_s / 2
    stop = one.found[0]
    await tab.click("td[data-at] button")
    assert await tab.run(CLOCK) == pytest.approx(stop.from_s, abs=0.02)
    assert (await tab.run(WHY)).startswith(stop.reason)
    painted = "document.querySelector('canvas').getContext('2d').getImageData(0, 0, 300, 200).data.some((v) => v > 0)"
    assert await tab.run(painted)
    assert set(tab.requests) == {file.as_uri()}
    assert tab.errors == []


async def test_the_path_is_that_of_the_lap_at_the_cursor(run, tab, tmp_path):
    truth = {"lap_times_s": [2.0, 3.0], "began_unix_s": run.zero_unix_s}
    await opened(tab, tmp_path, shown(run, truth))
    visible = (
        "[...document.querySelectorAll('.lap')].filter((e) => !e.hidden).map((e) => e.querySelector('h3').textContent)"
    )
    for at_s, lap in ((0.0, "lap 1"), (1.9, "lap 1"), (2.5, "lap 2"), (run.duration_s, "after the last lap")):
        await tab.run(f"go({at_s})")
        assert await tab.run(visible) == [lap]
    assert tab.errors == []


DOTS = """(() => {
  const paint = CanvasRenderingContext2D.prototype.fillRect, canvas = document.querySelector('.scene canvas'), xs = [];
  CanvasRenderingContext2D.prototype.fillRect = (x) => xs.push(x);
  go(3.0);
  CanvasRenderingContext2D.prototype.fillRect = paint;
  return [xs.slice(0, -1).reduce((sum, x) => sum + x, 0) / (xs.length - 1),
          Math.min(canvas.width, canvas.height) / (2 * view.around)];
})()"""


async def test_a_lidar_beside_the_middle_line_is_drawn_there(run, tab, tmp_path):
    """The scan moves to the left by as much; the car, painted last, stays."""
    aside = run.settings.car.model_copy(update={"lidar_y_m": 0.4})
    moved = replace(run, settings=run.settings.model_copy(update={"car": aside}))
    await opened(tab, tmp_path, shown(run))
    middle_px, gain = await tab.run(DOTS)
    await opened(tab, tmp_path, shown(moved))
    moved_px, _ = await tab.run(DOTS)
    assert moved_px - middle_px == pytest.approx(-0.4 * gain, rel=0.1)


async def test_zoom_shows_less_time_around_the_cursor(run, tab, tmp_path):
    await opened(tab, tmp_path, shown(run))
    whole = await tab.run(TICKS)
    await tab.run("go(4.0); 0")
    for _ in range(3):
        await tab.click("button[aria-label^='Show less']")
    near = await tab.run(TICKS)
    assert max(near) - min(near) < (max(whole) - min(whole)) / 3
    assert min(near) <= 4.0 <= max(near) + 0.3
    await tab.run("go(8.0); 0")
    assert max(await tab.run(TICKS)) > 7.5, "the span follows the cursor"
    await tab.click("button[aria-label^='Show the whole']")
    assert await tab.run(TICKS) == whole


async def test_it_plays_and_pauses(run, tab, tmp_path):
    await opened(tab, tmp_path, shown(run))
    await tab.click("button[aria-label^='Play']")
    await tab.until(f"{CLOCK} > 0.3")
    await tab.key("keyDown", "ArrowRight")
    await tab.click("button[aria-label^='Pause']")
    here = await tab.run(CLOCK)
    await tab.run("new Promise((done) => setTimeout(done, 200))")
    assert await tab.run(CLOCK) == here
    await tab.run("document.activeElement.blur(); 0")
    await tab.key("keyDown", "End")
    assert await tab.run(CLOCK) == pytest.approx(run.duration_s, abs=0.01)


@pytest.mark.parametrize("look", [0, 1])
async def test_two_runs_fit_and_axe_finds_nothing_serious(run, tab, tmp_path, look):
    await opened(tab, tmp_path, shown(run, None, "A"), shown(run, None, "B"), look=look)
    assert await tab.run("document.querySelectorAll('.scene canvas').length") == 2
    assert await tab.run("document.documentElement.scrollWidth") <= LOOKS[look]["width"]
    assert json.dumps(await violations(tab)) == "[]"
