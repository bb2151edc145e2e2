"""The page in a real Chromium, the server and the simulated car as processes, nothing faked but the car's hardware.

A stop is timed from before the browser is told until the brake is on the motor's wire, as the car recorded it.
"""

import asyncio
import logging
import os
import signal
import time
from urllib.parse import urlsplit

import pytest

from tests.promises import promise
from tests.system.watched import OPERATOR, brake_s, moves, watched

pytestmark = pytest.mark.timeout(150)

log = logging.getLogger("wallride.measured")

LOAD_S = 1.0
STOP_S = 0.1
GONE_S = 0.25
TOLD_S = 0.05
"""How long the browser itself may take from our order to close, hide or freeze a tab until it does so."""
WRITTEN_S = 1.3
"""What is younger may be missing in a recording that is cut off."""
STAYS_S = 0.6
RAW = ("recording.raw=true", "operator.slot_free_after_s=1")


async def press(page, way):
    """Press STOP."""
    if way in {"mouse", "touch"}:
        x, y = await page.middle("#stop")
    at_s = time.monotonic()
    match way:
        case "mouse":
            await page.mouse("mousePressed", x, y)
            await page.mouse("mouseReleased", x, y)
        case "touch":
            await page.touch("touchStart", (x, y))
            await page.touch("touchEnd")
        case _:
            await page.key("keyDown", way, "Space" if way == " " else way)
            await page.key("keyUp", way, "Space" if way == " " else way)
    return at_s


async def reset(scene):
    """Reset the e-stop and leave, so that autonomy goes on."""
    page = scene.page
    await page.click("#drive")
    await page.until("document.querySelector('#pilot-next').textContent.includes('reset')")
    x, y = await page.middle("#reset")
    await page.mouse("mousePressed", x, y)
    await scene.until(lambda: not scene.status["operator"]["e_stop"], "the e-stop is reset")
    await page.mouse("mouseReleased", x, y)
    await page.until("document.querySelector('#stop').dataset.state === 'ready'")
    await page.click("#drive")


async def test_the_page_shows_a_simulated_car_and_stop_brakes_it(tmp_path):
    async with watched(tmp_path, "loop", *RAW, "recording.start=request") as scene:
        page = await scene.open()
        ours = urlsplit(scene.url).netloc
        assert {urlsplit(address).netloc for address in page.requests} == {ours}, "no request to any other host"
        await page.go(scene.url)
        load_s = await page.run("performance.getEntriesByType('navigation')[0].loadEventEnd / 1000")
        await scene.until(lambda: scene.speed_mps > 0.5, "autonomy drives")
        await it_is_drawn(page)
        await page.click("#record")
        await scene.until(lambda: scene.status["recording"]["on"], "it records")
        await page.until("document.querySelector('#record').dataset.on === 'true'")
        pressed_s = []
        for way in ("mouse", "touch", " ", "Escape"):
            await scene.until(lambda: scene.speed_mps > 0.5, "autonomy drives", 15.0)
            pressed_s.append(await press(page, way))
            await scene.until(lambda: bool(scene.status["operator"]["e_stop"]), f"{way} latches the e-stop")
            assert list(scene.status["operator"]["e_stop"].values()) == [f"e-stop by {OPERATOR}"]
            await page.until("document.querySelector('#stop').dataset.state === 'latched'")
            await reset(scene)
        assert page.errors == []
        await asyncio.sleep(WRITTEN_S)
        motor = scene.wire()
    assert all(moves(motor, at_s - 0.5, at_s) for at_s in pressed_s), "it drove until then"
    assert not any(moves(motor, at_s + brake_s(motor, at_s), at_s + STAYS_S) for at_s in pressed_s), "and then stood"
    promise("loading", load_s, LOAD_S)
    promise("STOP by mouse, touch, Space and Escape", max(brake_s(motor, at_s) for at_s in pressed_s), STOP_S)


async def it_is_drawn(page):
    """Look for the scan's pixels, and for what else the page makes of the car."""
    await page.until("wallride.timings.latencies().length > 40")
    found_ms = sorted(await page.run("wallride.timings.latencies()"))
    log.info("from measurement to pixels: p50 %.1f ms of %d scans", found_ms[len(found_ms) // 2], len(found_ms))
    found = await page.run(
        "(() => { const canvas = document.querySelector('#scene'), { scan, wall, footprint } = wallride.link.newest;"
        " const dots = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;"
        " let inked = 0; for (let i = 0; i < dots.length; i += 4)"
        " inked += dots[i + 3] > 200 && dots[i] < 40 && dots[i + 1] < 50 && dots[i + 2] < 60;"
        " return { beams: scan.n, inked, wall: wall.find('wall')?.n, ball: wall.find('ball')?.n,"
        " way: footprint.find('left edge')?.n, car: footprint.find('car')?.n, samples: wallride.plots.samples,"
        " winner: document.querySelector('.voice[data-state=winner] b')?.textContent,"
        " state: document.querySelector('#state').textContent }; })()"
    )
    assert found["beams"] == 1081
    assert found["inked"] > 500, "the scan is on the canvas"
    assert found["wall"] == 2
    assert found["ball"] > 1
    assert (found["way"], found["car"]) == (16, 5)
    assert found["samples"] > 50
    assert found["winner"] in {"Navigation", "Safety"}
    assert found["state"] in {"driving", "limited"}


async def test_a_held_touch_moves_the_car_and_whatever_ends_it_stops_it(tmp_path):
    """Lifts the finger, then loses the page in every way in turn."""
    gone_s = {}
    settings = (*RAW, "recording.start=always", "operator.permit=required")
    async with watched(tmp_path, "corridor", *settings) as scene:
        other = await scene.browser.open()
        await scene.open()
        await scene.take_control()
        before_m = scene.status["odom"]["x_m"]
        await scene.drive_by_touch()
        await scene.until(lambda: scene.status["odom"]["x_m"] - before_m > 0.3, "it really moves")
        lifted_s = time.monotonic()
        await scene.page.touch("touchEnd")
        await scene.until_stopped(lifted_s)
        for way in ("close", "hide", "freeze", "kill"):
            await scene.drive_by_touch()
            frozen = scene.browser.renderers() if way == "freeze" else []
            gone_s[way] = time.monotonic()
            await lose(scene, way, frozen, other)
            await scene.until_stopped(gone_s[way])
            await asyncio.sleep(STAYS_S)
            for number in frozen:
                os.kill(number, signal.SIGCONT)
            if way != "kill":
                await scene.page.close()
                await scene.open()
                await scene.take_control()
        await asyncio.sleep(WRITTEN_S)
        motor = scene.wire()
    for way, at_s in gone_s.items():
        assert moves(motor, at_s - 0.3, at_s), f"{way}: it drove until then"
        assert not moves(motor, at_s + brake_s(motor, at_s), at_s + STAYS_S), f"{way}: nobody drives on"
    promise("STOP by letting go", brake_s(motor, lifted_s), STOP_S)
    for way, at_s in gone_s.items():
        promise(f"the page is gone: {way}", brake_s(motor, at_s), GONE_S + TOLD_S)


async def lose(scene, way, frozen, other):
    """Have the page go in the middle of a drive."""
    match way:
        case "close":
            await scene.page.close()
        case "hide":
            await scene.browser.show(other)
        case "freeze":
            for number in frozen:
                os.kill(number, signal.SIGSTOP)
        case "kill":
            scene.monitor.process.kill()
