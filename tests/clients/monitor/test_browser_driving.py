"""The page drives the car and stops it, in a real Chromium, against a real operator desk."""

import asyncio
import os
import signal
import time

import pytest

from tests.clients.monitor.operating import drive_by_touch, insist, operate, stops_and_stays, take_control, watching
from tests.promises import promise

pytestmark = pytest.mark.timeout(120)
STOP_S = 0.1
GONE_S = 0.25
NORMAL_SHARE_MPS = 0.75
"""Half of the top speed is what the page's slider stands at."""


@pytest.mark.parametrize("way", ["mouse", "space", "escape", "touch"])
async def test_stop_brakes_the_car_at_once(scene, tab, way):
    async with scene.car(permit="always", autonomy=True) as car, scene.monitor():
        await watching(tab, scene)
        await car.until(lambda: car.speed_mps == 1.0, "autonomy drives")
        if way in {"mouse", "touch"}:
            x, y = await tab.middle("#stop")
        pressed_s = time.monotonic()
        match way:
            case "mouse":
                await tab.mouse("mousePressed", x, y)
            case "touch":
                await tab.touch("touchStart", (x, y))
            case "space":
                await tab.key("keyDown", " ", "Space")
            case "escape":
                await tab.key("keyDown", "Escape")
        await car.until(lambda: car.e_stop.latched, "the e-stop has latched")
        took_s = car.stopped_at_s(pressed_s) - pressed_s
        assert list(car.e_stop.causes.values()) == ["e-stop by ann@laptop"]
        await tab.until("document.querySelector('#stop').dataset.state === 'latched'")
        promise(f"STOP by {way}", took_s, STOP_S)


async def test_the_page_drives_by_touch_and_stops_when_the_finger_lifts(tab, car):
    x, y = await tab.middle("#touch")
    await tab.touch("touchStart", (x, y))
    await tab.touch("touchMove", (x, y - 60))
    await asyncio.sleep(0.3)
    await tab.touch("touchEnd")
    assert car.history[1:] == [], "nothing moves before control was taken"
    await take_control(tab)
    await drive_by_touch(tab, car)
    lifted_s = time.monotonic()
    await tab.touch("touchEnd")
    await car.until(lambda: car.speed_mps == 0, "released means stop")
    assert max(speed_mps for _, speed_mps in car.history) <= NORMAL_SHARE_MPS + 1e-3
    promise("the lifted finger", car.stopped_at_s(lifted_s) - lifted_s, STOP_S)


async def test_the_page_drives_with_the_keyboard_alone(tab, car):
    await tab.run("document.querySelector('#drive').focus()")
    await tab.call(
        "Input.dispatchKeyEvent", type="keyDown", key="Enter", code="Enter", text="\r", windowsVirtualKeyCode=13
    )
    await tab.key("keyUp", "Enter")
    await tab.until("document.querySelector('#pilot-state').textContent === 'ready'")

    async def hold():
        await tab.key("keyDown", "ArrowUp")
        await asyncio.sleep(0.1)
        await tab.key("keyDown", "ArrowLeft")

    async def let_go():
        await tab.key("keyUp", "ArrowLeft")
        await tab.key("keyUp", "ArrowUp")

    await insist(
        car, hold, let_go, lambda: car.speed_mps > 0.3 and (car.decision.steering_rad or 0) > 0.2,
        "the arrow keys drive and steer to the left",
    )  # fmt: skip
    await tab.key("keyUp", "ArrowUp")
    await car.until(lambda: car.speed_mps == 0, "released means stop")


@pytest.mark.parametrize("permit", ["required", "always"])
@pytest.mark.parametrize("way", ["close", "hide", "freeze", "blur", "navigate"])
async def test_a_page_that_goes_while_it_drives_stops_the_car(scene, tab, way, permit):
    autonomy = permit == "always"  # which must not take over
    async with scene.car(permit=permit, autonomy=autonomy) as car, scene.monitor():
        other = await tab.browser.open() if way == "hide" else None
        await tab.browser.show(tab)
        await watching(tab, scene)
        await take_control(tab)
        await drive_by_touch(tab, car)
        frozen = tab.browser.renderers() if way == "freeze" else []
        assert bool(frozen) is (way == "freeze")
        gone_s = time.monotonic()
        try:
            match way:
                case "close":
                    await tab.close()
                case "hide":
                    await tab.browser.show(other)
                case "freeze":
                    for number in frozen:
                        os.kill(number, signal.SIGSTOP)
                case "blur":
                    await tab.run("window.dispatchEvent(new Event('blur'))")
                case "navigate":
                    await tab.call("Page.navigate", url="about:blank")
            promise(f"{way}, permit {permit}", await stops_and_stays(car, gone_s), GONE_S)
        finally:
            for number in frozen:
                os.kill(number, signal.SIGCONT)


async def test_one_operator_at_a_time_with_take_over(scene, tab):
    async with scene.car() as car, scene.monitor():
        rival = asyncio.create_task(operate(car))
        try:
            await watching(tab, scene)
            await car.until(lambda: car.desk.view().operator == "rival", "another operator drives")
            await tab.click("#drive")
            await tab.until("document.querySelector('#pilot-next').textContent.includes('take over')")
            assert "rival" in await tab.run("document.querySelector('#pilot-state').textContent")
            x, y = await tab.middle("#take-over")
            await insist(
                car, lambda: tab.mouse("mousePressed", x, y), lambda: tab.mouse("mouseReleased", x, y),
                lambda: car.desk.view().operator == "ann@laptop", "taken over",
            )  # fmt: skip
            await tab.mouse("mouseReleased", x, y)
            assert car.speed_mps == 0
            await tab.until("document.querySelector('#pilot-state').textContent === 'ready'")
        finally:
            rival.cancel()


async def test_an_e_stop_is_reset_deliberately(tab, car):
    await tab.key("keyDown", " ", "Space")
    await car.until(lambda: car.e_stop.latched, "stopped")
    await tab.key("keyUp", " ", "Space")
    assert await tab.run("document.querySelector('#reset').disabled")
    await tab.click("#drive")
    await tab.until("document.querySelector('#pilot-next').textContent.includes('reset')")
    x, y = await tab.middle("#reset")
    held_s = await insist(
        car, lambda: tab.mouse("mousePressed", x, y), lambda: tab.mouse("mouseReleased", x, y),
        lambda: not car.e_stop.latched, "reset",
    )  # fmt: skip
    await tab.mouse("mouseReleased", x, y)
    assert held_s > 0.8
    await tab.until("document.querySelector('#stop').dataset.state === 'ready'")


async def test_a_gamepad_drives_and_stops(scene, tab):
    async with scene.car() as car, scene.monitor():
        await tab.call(
            "Page.addScriptToEvaluateOnNewDocument",
            source="""
            window.pad = {connected: true, id: 'test', mapping: 'standard', timestamp: 1, axes: [0, 0, 0, 0],
              buttons: Array.from({length: 17}, () => ({pressed: false, value: 0}))};
            window.press = (i, down) => { pad.buttons[i] = {pressed: down, value: Number(down)}; pad.timestamp++; };
            navigator.getGamepads = () => [window.pad];
            setInterval(() => { if (window.alive !== false) pad.timestamp++; }, 50);
            """,
        )
        await watching(tab, scene)
        await take_control(tab)

        async def hold():
            await tab.run("press(4, true)")
            await asyncio.sleep(0.1)
            await tab.run("pad.axes[1] = -1; pad.axes[2] = -1")

        await insist(
            car, hold, lambda: tab.run("pad.axes.fill(0); press(4, false)"),
            lambda: car.speed_mps > 0.5 and (car.decision.steering_rad or 0) > 0.3, "the sticks drive to the left",
        )  # fmt: skip
        await tab.run("window.alive = false")
        await car.until(lambda: car.speed_mps == 0, "a pad that says nothing more is no pad", within_s=2)
        await tab.run("window.alive = true; pad.axes.fill(0); press(4, false)")
        await tab.until("document.querySelector('#pilot-state').textContent === 'ready'")
        await tab.run("press(1, true)")
        await car.until(lambda: car.e_stop.latched, "the pad's own stop button")
