"""The page for everyone: axe-core finds nothing serious, on desk and phone, light and dark, in each of its states."""

import pytest

from tests.clients.monitor.axe import violations
from tests.clients.monitor.operating import take_control

SCREENS = {"desk": (1400, 900, False), "phone": (390, 844, True), "phone sideways": (844, 390, True)}


async def open_on(tab, scene, screen, *, dark):
    width, height, mobile = SCREENS[screen]
    await tab.call("Emulation.setTouchEmulationEnabled", enabled=mobile)
    await tab.look(width=width, height=height, mobile=mobile, dark=dark)
    await tab.go(scene.url)
    await tab.until("window.wallride && wallride.timings.count > 3")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("screen", SCREENS)
async def test_axe_finds_nothing_serious(scene, tab, screen, dark):
    async with scene.car(simulated=True) as car, scene.monitor():
        await open_on(tab, scene, screen, dark=dark)
        await tab.until("document.querySelector('#simulator').checkVisibility()")
        assert await violations(tab) == [], "watching"
        await tab.run("document.querySelector('#settings').open = true")
        await tab.until("document.querySelectorAll('.setting').length > 5")
        await tab.run("for (const group of document.querySelectorAll('.group')) group.open = true")
        assert await violations(tab) == [], "settings"
        await tab.run("document.querySelector('#settings').open = false")
        await take_control(tab)
        car.overruled = {"speed_mps": 0.0, "reason": "braking: wall ahead", "measure": 0.4}
        await tab.until("!document.querySelector('#overruled').hidden")
        assert await violations(tab) == [], "driving, not bound by safety"
        await tab.key("keyDown", "Escape")
        await car.until(lambda: car.e_stop.latched, "stopped")
        await tab.until("document.querySelector('#stop').dataset.state === 'latched'")
        assert await violations(tab) == [], "e-stop"


async def test_axe_finds_nothing_serious_without_a_car(scene, tab):
    async with scene.monitor():
        await tab.look(width=1400, height=900)
        await tab.go(scene.url)
        await tab.until("document.querySelector('#state').textContent === 'no car'")
        assert await violations(tab) == []


async def test_axe_is_really_asked(scene, tab):
    async with scene.car(), scene.monitor():
        await open_on(tab, scene, "desk", dark=False)
        await tab.run("document.querySelector('#zoom-in').removeAttribute('aria-label');")
        await tab.run("document.querySelector('#zoom-in').textContent = ''")
        assert ("button-name", "critical", [["#zoom-in"]]) in await violations(tab)


async def test_figures_that_change_often_are_not_read_out(scene, tab):
    """Whatever lies in a live region is spoken at each change."""
    async with scene.car(autonomy=True, permit="always"), scene.monitor():
        await open_on(tab, scene, "desk", dark=False)
        await take_control(tab)
        live = "[role=status], [role=alert], [role=log], [aria-live], output"
        await tab.run(
            f"window.spoken = []; for (const region of document.querySelectorAll('{live}')) new MutationObserver(() =>"
            " spoken.push(region.id)).observe(region, {childList: true, characterData: true, subtree: true}); undefined"
        )
        await tab.run("new Promise((done) => setTimeout(done, 2000))")
        assert await tab.run("spoken") == []
