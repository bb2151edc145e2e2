"""The map of a lap in a real Chromium: pressed for, shown with its verdict and picture, raced along, or refused."""

from tests.clients.monitor.axe import violations
from tests.clients.monitor.lap_commands import NAME, OPEN, LapCommands, recorded
from tests.clients.monitor.operating import watching
from wallride.runtime.settings.tree import load_settings

WORDS = "document.querySelector('#lap-map-words').innerText"
SHOWN = "[...document.querySelectorAll('#lap-map-pictures img')].map((img) => img.naturalWidth)"
VISIBLE = "['begin', 'cancel', 'race'].filter((name) => document.querySelector(`#lap-map-${name}`).checkVisibility())"


FILE = '[wall_follow]\nmethod = "ball"\n'


async def panel(tab, scene):
    await watching(tab, scene)
    await tab.run("document.querySelector('#lap-map').open = true")
    await tab.until("wallride.link.newest.lap_map.value?.stage === 'none'")


async def test_a_map_is_made_looked_at_and_raced_along(scene, tab, tmp_path, car_toml):
    commands = LapCommands()
    commands.gate.clear()
    async with scene.car() as car, scene.monitor(config=car_toml, run=commands):
        car.recordings = recorded(tmp_path / "recordings")
        await panel(tab, scene)
        assert await tab.run(VISIBLE) == ["begin"]
        await tab.click("#lap-map-begin")
        await tab.until(f"{WORDS}.includes('Making the map of {NAME}')")
        assert await tab.run(VISIBLE) == ["begin", "cancel"]
        assert await tab.run("document.querySelector('#lap-map-begin').disabled")
        commands.gate.set()
        await tab.until(f"{WORDS}.includes('The map is good.')")
        await tab.until(f"{SHOWN}.join() === '1,1'")
        await tab.until(f"{VISIBLE}.join() === 'begin,race'")
        assert await violations(tab) == [], "with a map"
        speed = "document.querySelector('#lap-map-speed input')"
        assert await tab.run(f"{speed}.value") == "6.0", "the line's highest"
        before = car_toml.read_text()
        await tab.run(f"{speed}.value = ''")
        await tab.click("#lap-map-race")
        assert await tab.run(f"{speed}.validity.valueMissing"), "nothing is sent"
        await tab.run(f"{speed}.value = 3.5")
        car.standing = False
        await tab.click("#lap-map-race")
        await tab.until(f"{WORDS}.includes('no restart: only while the car stands; stop it first')")
        assert (car_toml.read_text(), car.restarts) == (before, 0)
        assert await tab.run("document.querySelector('#lap-map').dataset.stage") == "refused", "in its colour"
        car.standing = True
        await tab.click("#lap-map-race")
        await tab.until(f"{WORDS}.includes('The car starts anew, disarmed.')")
        assert await tab.run(VISIBLE) == ["begin"]
        assert not await tab.run(f"{speed}.checkVisibility()")
        assert car.restarts == 1
        settings = load_settings(car_toml)
        assert (settings.wall_follow.method, settings.wall_follow.speed_mps) == ("line", 3.5)
        assert settings.map.file.endswith(NAME.replace(".mcap", ".yaml"))
        assert tab.errors == []


async def test_an_open_ring_is_told_and_offers_no_race(scene, tab, tmp_path, car_toml):
    commands = LapCommands()
    commands.reasons = [OPEN]
    async with scene.car() as car, scene.monitor(config=car_toml, run=commands):
        car.recordings = recorded(tmp_path / "recordings")
        await panel(tab, scene)
        await tab.click("#lap-map-begin")
        await tab.until(f"{WORDS}.includes('The map is refused: the ring is open')")
        await tab.until(f"{SHOWN}.join() === '1'")
        assert await tab.run(VISIBLE) == ["begin"]
        assert await violations(tab) == [], "with a refused map"


async def test_what_cannot_be_begun_is_said_and_what_is_begun_can_be_cancelled(scene, tab, tmp_path):
    commands = LapCommands()
    commands.gate.clear()
    async with scene.car() as car, scene.monitor(run=commands):
        car.recordings = recorded(tmp_path / "recordings")
        await panel(tab, scene)
        await tab.click("#lap-map-begin")
        await tab.until(f"{VISIBLE}.includes('cancel')")
        await tab.run("wallride.link.say({ t: 'map_lap', do: 'begin' })")
        await tab.until("document.querySelector('#notice').textContent.includes('wait for it, or cancel it')")
        await tab.click("#lap-map-cancel")
        await tab.until(f"{WORDS} === 'Cancelled.'")
        assert await tab.run(VISIBLE) == ["begin"]
        commands.gate.set()
        await tab.click("#lap-map-begin")
        await tab.until("document.querySelector('#lap-map-lines').textContent.includes('[map]')")
        assert not await tab.run("document.querySelector('#lap-map-race').checkVisibility()"), "there is no file here"


async def test_a_page_that_is_opened_later_shows_the_same_map(scene, tab, tmp_path):
    async with scene.car() as car, scene.monitor(run=LapCommands()):
        car.recordings = recorded(tmp_path / "recordings")
        await panel(tab, scene)
        await tab.click("#lap-map-begin")
        await tab.until(f"{SHOWN}.length === 2")
        await watching(tab, scene)
        await tab.run("document.querySelector('#lap-map').open = true")
        await tab.until(f"{WORDS}.includes('The map is good.') && {SHOWN}.join() === '1,1'")


async def test_the_way_of_the_lap_is_told_outside_of_the_panel(tab, car):
    assert not await tab.run("document.querySelector('#line-lap').checkVisibility()")
    for x_m in range(9):
        car.odom = {"x_m": x_m, "y_m": 0, "yaw_rad": 0}
        await tab.until(f"wallride.link.newest.status.value.odom.x_m === {x_m}")
    await tab.until("document.querySelector('#line-lap dd').innerText.startsWith('8 m of way')")
    place = dict.fromkeys(("x_m", "y_m", "yaw_rad"), 0)
    car.pose = {"map": "lab", "whereabouts": "located", **place, "std_m": 0.1, "fits": 1, "alike": []}
    await tab.until("!document.querySelector('#line-lap').checkVisibility()")
