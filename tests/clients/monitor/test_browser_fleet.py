"""All cars on one page in a real Chromium: their rows, one STOP for all, each car's own page, and the race."""

import asyncio
import math
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from tests.clients.monitor.axe import violations
from tests.clients.monitor.fake_car import FakeCar
from tests.clients.monitor.operating import SCREENS, opened, take_control, watching
from tests.system.poor_link import PoorLink, Quality
from wallride.runtime.wire.ports import free_endpoint

pytestmark = pytest.mark.timeout(120)
ROWS = "[...document.querySelectorAll('#fleet-rows tr')].map((row) => row.querySelector('.car').textContent)"
SLOW = Quality(delay_s=0.15, jitter_s=0.02, loss=0.0)


def cell(car, column):
    return (
        "[...document.querySelectorAll('#fleet-rows tr')].find((row) =>"
        f" row.querySelector('.car').textContent === '{car}').querySelector('.{column}').textContent"
    )


@asynccontextmanager
async def cars_at(scene, count, *, slow=()):
    """Yield cars car1 to carN, each at an endpoint of its own, and the monitor of all; slow: behind a poor link."""
    async with AsyncExitStack() as stack:
        cars, places = [], []
        for k in range(count):
            endpoint = scene.endpoint if k == 0 else free_endpoint()
            car = FakeCar(endpoint, f"car{k + 1}", car_session=0xCAFE + k, autonomy=True, permit="always")
            cars.append(await stack.enter_async_context(car))
            if k + 1 in slow:
                link = PoorLink(int(endpoint.rpartition(":")[2]), SLOW)
                await link.start()
                stack.push_async_callback(link.close)
                endpoint = link.endpoint
            places.append(endpoint)
        await stack.enter_async_context(scene.monitor(also=places[1:]))
        yield cars


async def look_at_all(tab, scene, count, screen="desk", *, dark=False):
    await opened(tab, f"{scene.url}#all", screen, dark=dark)
    await tab.until(f"window.wallride && {ROWS}.length === {count}", within_s=20)
    await tab.until("document.body.dataset.linked === 'true'")


async def test_each_car_has_a_row_and_a_click_opens_its_page_and_back_all_of_them(scene, tab):
    async with cars_at(scene, 3) as cars:
        await look_at_all(tab, scene, 3)
        assert await tab.run(ROWS) == ["car1", "car2", "car3"]
        await tab.until(f"{cell('car2', 'state')} === 'driving'")
        assert await tab.run(cell("car2", "speed")) == "1.00 m/s"
        assert await tab.run(cell("car2", "error")) == "2.1 cm"
        assert await tab.run(cell("car2", "battery")) == "11.8 V"
        await tab.until(f"{cell('car2', 'link')}.includes('round trip')", within_s=15)
        assert "follows the wall" in await tab.run(cell("car2", "why"))
        assert not await tab.run("document.querySelector('#driving').checkVisibility()"), "nothing drives from here"
        assert await tab.run("document.querySelector('#stop').textContent.startsWith('STOP ALL')")
        await tab.click("#fleet-rows tr:nth-child(2) button")
        await tab.until("wallride.car === 'car2' && wallride.link.newest.beat.carSession === 0xCAFF")
        await tab.until("document.body.dataset.linked === 'true'")
        assert await tab.run("document.querySelector('#stop b').textContent") == "STOP"
        await tab.click("#stop")
        await cars[1].until(lambda: cars[1].e_stop.latched, "the open car is stopped")
        assert not cars[0].e_stop.latched, "and no other one"
        await tab.run("history.back()")
        await tab.until(f"document.body.dataset.view === 'all' && {ROWS}.length === 3")
        assert tab.errors == []


async def test_one_stop_stops_all_also_over_a_slow_link_and_says_who_has_not_confirmed(scene, tab):
    async with cars_at(scene, 3, slow=[3]) as cars:
        await look_at_all(tab, scene, 3)
        await tab.until(f"{cell('car3', 'link')}.startsWith('LINK SLOW')", within_s=20)
        await tab.click("#stop")
        near = [cars[0].until(lambda: cars[0].e_stop.latched, "1"), cars[1].until(lambda: cars[1].e_stop.latched, "2")]
        assert max(await asyncio.gather(*near)) < 1.0, "no car waits for the slow one"
        await tab.until("document.querySelector('#stop-note').textContent.includes('not yet: car3')", within_s=2)
        await cars[2].until(lambda: cars[2].e_stop.latched, "over the slow link", within_s=5)
        await tab.until("document.querySelector('#stop-note').textContent === '3 of 3 have stopped'", within_s=5)


async def test_a_car_that_does_not_confirm_is_named(scene, tab):
    async with cars_at(scene, 2) as cars:
        await look_at_all(tab, scene, 2)
        deaf = cars[1]
        deaf.desk.receive = lambda *_: None
        await tab.key("keyDown", "Escape")
        await cars[0].until(lambda: cars[0].e_stop.latched, "stopped by Esc")
        note = "document.querySelector('#stop-note').textContent"
        await tab.until(f"{note} === 'NOT CONFIRMED: car2'", within_s=15)  # 10 s of repetition


async def test_leaving_a_car_for_all_of_them_ends_driving_it(scene, tab):
    async with cars_at(scene, 2) as cars:
        await watching(tab, scene)
        await tab.until("wallride.car === 'car1'")
        await take_control(tab)
        await tab.until("document.querySelector('#all-cars').checkVisibility()")
        await tab.click("#all-cars")
        await tab.until(f"{ROWS}.length === 2")
        assert await tab.run("wallride.hands.engaged") is False
        await cars[0].until(lambda: not cars[0].beat.operator_session, "the page has let go")


async def test_a_silent_car_and_a_silent_monitor_look_old(scene, tab):
    async with AsyncExitStack() as stack:
        cars = await stack.enter_async_context(cars_at(scene, 2))
        await look_at_all(tab, scene, 2)
        cars[1].publishing = False
        await tab.until(f"{cell('car2', 'state')} === 'not heard'", within_s=5)
        assert await tab.run(cell("car1", "state")) == "driving"
        await stack.aclose()
        await tab.until("document.querySelector('#fleet').dataset.old === 'true'", within_s=5)
        await tab.until("document.body.dataset.linked === 'false'")


async def test_laps_and_gaps_are_counted_while_cars_go_round(scene, tab):
    async with cars_at(scene, 2) as cars:
        await look_at_all(tab, scene, 2)
        for step in range(90):
            for car, period_s in ((cars[0], 3.0), (cars[1], 2.0)):
                angle_rad = math.tau * step * 0.1 / period_s
                car.odom = {"x_m": math.sin(angle_rad), "y_m": 1 - math.cos(angle_rad), "yaw_rad": angle_rad}
            await asyncio.sleep(0.1)
        await tab.until(f"Number({cell('car2', 'laps')}) >= 3", within_s=3)
        assert await tab.run(ROWS) == ["car2", "car1"], "the first one first"
        assert await tab.run(cell("car2", "position")) == "1"
        assert (await tab.run(cell("car1", "gap"))).startswith("+")
        assert float((await tab.run(cell("car2", "best"))).removesuffix(" s")) == pytest.approx(2.0, abs=0.5)
        await tab.click("#new-race")
        await tab.until(f"{cell('car2', 'laps')} === '0'")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("screen", SCREENS)
async def test_axe_finds_nothing_serious_on_all_cars(scene, tab, screen, dark):
    async with cars_at(scene, 2) as cars:
        await look_at_all(tab, scene, 2, screen, dark=dark)
        await tab.until(f"{cell('car1', 'state')} === 'driving'")
        assert await violations(tab) == [], "driving"
        cars[1].publishing = False
        await tab.until(f"{cell('car2', 'state')} === 'not heard'", within_s=5)
        await tab.key("keyDown", "Escape")
        await cars[0].until(lambda: cars[0].e_stop.latched, "stopped")
        assert await violations(tab) == [], "one is silent, all are stopped"
        assert await tab.run("document.documentElement.scrollWidth <= innerWidth"), "nothing is cut off"
        await tab.until("document.querySelector('#stop-note').checkVisibility()", within_s=2)
