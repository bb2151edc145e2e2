"""The page for everyone: axe-core finds nothing serious, on desk and phone, light and dark, in each of its states."""

import pytest

from tests.clients.monitor.axe import violations
from tests.clients.monitor.operating import SCREENS, opened, take_control, watching


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("screen", SCREENS)
async def test_axe_finds_nothing_serious(scene, tab, screen, dark):
    async with scene.car(simulated=True) as car, scene.monitor():
        await watching(tab, scene, screen, dark=dark)
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
        await opened(tab, scene.url)
        await tab.until("document.querySelector('#state').textContent === 'no car'")
        assert await violations(tab) == []


async def test_axe_is_really_asked(scene, tab):
    async with scene.car(), scene.monitor():
        await watching(tab, scene)
        await tab.run("document.querySelector('#zoom-in').removeAttribute('aria-label');")
        await tab.run("document.querySelector('#zoom-in').textContent = ''")
        assert ("button-name", "critical", [["#zoom-in"]]) in await violations(tab)


async def test_figures_that_change_often_are_not_read_out(scene, tab):
    """Whatever lies in a live region is spoken at each change."""
    async with scene.car(autonomy=True, permit="always"), scene.monitor():
        await watching(tab, scene)
        await take_control(tab)
        live = "[role=status], [role=alert], [role=log], [aria-live], output"
        await tab.run(
            f"window.spoken = []; for (const region of document.querySelectorAll('{live}')) new MutationObserver(() =>"
            " spoken.push(region.id)).observe(region, {childList: true, characterData: true, subtree: true}); undefined"
        )
        await tab.run("new Promise((done) => setTimeout(done, 2000))")
        assert await tab.run("spoken") == []
