"""The page says what is so: who operates, whether there is a car, what this device has; and what safety would do."""

import asyncio

import pytest

from tests.clients.monitor.operating import hold_pad, opened, operate, take_control, watching
from tests.sim.replay.recorded import record
from wallride.runtime.arbitration.driving_state import CLEARED_BY
from wallride.runtime.arbitration.emergency_stop import Cause
from wallride.sim.replay import publish
from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.player import Player

STATE, WHY = "document.querySelector('#state').textContent", "document.querySelector('#why').textContent"
NEXT = "document.querySelector('#pilot-next').textContent"
PILOT = "document.querySelector('#pilot-state').textContent"
GONE = "No car to drive: it ended, or its link is gone. Start one: make sim here, or wallride run on the car."
OPERATOR = "document.querySelector('#line-operator dd').textContent"


async def test_without_a_car_the_page_says_what_to_start(scene, tab):
    async with scene.monitor():
        await opened(tab, scene.url)
        await tab.until(f"{STATE} === 'no car'")
        await asyncio.sleep(1.5)  # the reason of the first failed connection is there by now
        said = await tab.run("document.body.innerText")
        assert f"No car at {scene.endpoint}. Start one: make sim here, or wallride run on the car." in said
        for wrong in (".rs", "cargo", "Single(", "inf ", "never ago", "Timeout"):
            assert wrong not in said
        assert await tab.run(NEXT) == GONE


async def test_a_played_recording_is_told_and_is_no_car_to_drive(scene, tab, tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "single_keys", lambda: None)
    await asyncio.to_thread(record, tmp_path / "drive.mcap", seconds=3.0)
    player = Player(read_log(tmp_path / "drive.mcap"), asyncio.get_running_loop().time, loops=True)
    playing = asyncio.create_task(publish.Broadcast(player, "car1", scene.endpoint).run())
    async with scene.monitor():
        await opened(tab, scene.url)
        await tab.until(
            f"{STATE} === 'recording' && {WHY}.startsWith('A recording is played here; nothing drives. Then: ')"
        )
        await tab.until(f"{NEXT} === 'A recording is played here: there is no car to drive.'")
        assert await tab.run("document.querySelector('#link-age').textContent") == "recording"
    playing.cancel()


async def test_a_car_that_went_away_is_named(scene, tab):
    async with scene.monitor():
        async with scene.car():
            await watching(tab, scene)
        await tab.until(f"{STATE} === 'no car' && {WHY}.includes('No car at')", within_s=15)
        async with scene.car():
            await tab.until(f"{STATE} !== 'no car'", within_s=15)


async def test_the_last_words_of_the_server_stay_and_no_age_stands_still(scene, tab, tmp_path):
    farewell = tmp_path / "farewell"
    async with scene.car():
        async with scene.monitor(farewell=farewell):
            await watching(tab, scene)
            await take_control(tab)
            farewell.write_text("The drive ended: the car touched something. Start another: make sim.")
        await tab.until(f"{WHY} === 'The drive ended: the car touched something. Start another: make sim.'")
        await asyncio.sleep(1.0)  # it tries to come back meanwhile, which has no last words
        assert await tab.run(WHY) == await tab.run(NEXT) == farewell.read_text()
        assert await tab.run(STATE) == await tab.run(PILOT) == "ended"
        assert "link lost" not in await tab.run("document.body.innerText")
        async with scene.monitor():
            await tab.until(f"{STATE} === 'driving' || {STATE} !== 'ended'", within_s=15)
            await tab.until(f"{PILOT} === 'watching'")
        await tab.until(f"{WHY} === 'The monitor was ended. Start it again: wallride monitor.'")


async def test_a_page_that_drives_a_car_that_ends_counts_on_and_says_what_to_start(scene, tab):
    async with scene.monitor():
        async with scene.car():
            await watching(tab, scene)
            await take_control(tab)
        await tab.until(f"{NEXT}.includes('link lost 0.')")
        await tab.until(f"{NEXT}.includes('link lost 2.')")
        await tab.until(f"{PILOT} === 'no car' && {NEXT} === '{GONE}'", within_s=15)


async def test_an_operator_who_was_lost_is_named_and_does_not_operate(scene, tab):
    async with scene.car() as car, scene.monitor():
        rival = asyncio.create_task(operate(car))
        await watching(tab, scene)
        await tab.until(f"{NEXT} === 'rival operates.'")
        rival.cancel()
        await car.until(lambda: "lost" in str(car.desk.view().standing), "lost")
        await tab.until(f"{NEXT} === 'Not operated: rival was lost. Switch Drive on to take control.'")
        await tab.until(f"{OPERATOR}.startsWith('not operated, rival was lost')")
        assert "nobody" not in await tab.run(OPERATOR)


async def test_a_page_that_was_lost_and_is_ready_again_says_that_the_car_stands(tab, car):
    await hold_pad(tab, car)
    await tab.run("wallride.hands.abandon()")
    await car.until(lambda: "lost" in str(car.desk.view().standing), "lost")
    await tab.touch("touchEnd")
    await take_control(tab)
    await tab.until(f"{NEXT}.startsWith('the car stands; hold the drive pad')")


async def test_it_tells_this_page_from_another(scene, tab):
    async with scene.car() as car, scene.monitor():
        other = await tab.browser.open()
        await tab.browser.show(tab)
        await watching(tab, scene)
        await tab.until(f"{NEXT} === 'Not operated. Switch Drive on to take control.'")
        await watching(other, scene)
        await tab.browser.show(tab)
        await hold_pad(tab, car)
        await tab.until(f"{OPERATOR}.includes('ann@laptop on this page')")
        await other.until("wallride.link.newest.pilot.value?.whose === 'another page'")
        await other.until(f"{NEXT} === 'ann@laptop operates, on another page.'")


async def test_a_stop_without_a_link_goes_out_when_the_link_is_back(scene, tab):
    async with scene.car() as car:
        async with scene.monitor():
            await watching(tab, scene)
        await tab.until("document.body.dataset.linked === 'false'")
        await tab.click("#stop")
        await tab.until("document.querySelector('#stop-note').textContent === 'no link! sent when it is back'")
        assert "STOP NOT SENT" in await tab.run("document.querySelector('#notice').textContent")
        assert not car.e_stop.latched
        async with scene.monitor():
            await car.until(lambda: car.e_stop.latched, "the STOP of before", within_s=15)


async def test_a_stop_that_a_hanging_link_swallowed_goes_out_by_the_next_one(scene, tab):
    async with scene.car() as car, scene.monitor():
        await watching(tab, scene)
        await tab.run("window.send = WebSocket.prototype.send; WebSocket.prototype.send = () => undefined")
        await tab.click("#stop")
        await tab.until("document.querySelector('#stop').dataset.state === 'pending'")
        await tab.until("!wallride.link.open", within_s=15)
        assert not car.e_stop.latched
        await tab.run("WebSocket.prototype.send = window.send")
        await car.until(lambda: car.e_stop.latched, "the STOP of before", within_s=15)
        await tab.until("document.querySelector('#stop').dataset.state === 'latched'")


async def test_a_page_that_is_opened_later_has_the_minutes_before_it(scene, tab, car):
    await asyncio.sleep(3)
    await tab.go(scene.url)
    ages = (
        "Object.fromEntries(wallride.plots.strips.flatMap((strip) => strip.lines.map(({label, series}) => [label,"
        " series.count ? performance.now() - series.t[series.at(series.count - 1)] : 0])))"
    )
    await tab.until("window.wallride && wallride.timings.count > 2")
    found = await tab.run(ages)
    assert set(found) == {"error", "asked", "sent", "driven", "scan to motor p99", "round trip"}
    for label in ("error", "sent", "driven", "scan to motor p99"):
        assert found[label] > 2500, f"{label} begins only {found[label]:.0f} ms ago"


@pytest.mark.parametrize("screen", ["phone", "phone sideways"])
async def test_a_phone_reaches_all_that_is_held_without_scrolling(scene, tab, screen):
    async with scene.car() as car, scene.monitor():
        await watching(tab, scene, screen)
        await tab.run("document.querySelector('#drive').click()")
        await tab.until(f"{PILOT} === 'ready'")
        hit = (
            "(id) => { const e = document.getElementById(id), b = e.getBoundingClientRect();"
            " const at = (x, y) => e.contains(document.elementFromPoint(x, y));"
            " return b.top >= 0 && b.left >= 0 && b.bottom <= innerHeight && b.right <= innerWidth && b.height >= 44"
            " && at(b.x + b.width / 2, b.y + b.height / 2) && at(b.x + 6, b.y + b.height / 2)"
            " && at(b.right - 6, b.y + b.height / 2); }"
        )
        for name in ("stop", "autonomy", "reset", "touch"):
            assert await tab.run(f"({hit})('{name}')"), f"{name} is covered or off the screen"
        gap = (
            "Math.abs(document.querySelector('#autonomy').getBoundingClientRect().right"
            " - document.querySelector('#stop').getBoundingClientRect().left)"
        )
        if screen == "phone":
            assert await tab.run(gap) < 30, "beside STOP"
        rival = asyncio.create_task(operate(car))
        try:
            await tab.until("getComputedStyle(document.querySelector('#take-over')).display !== 'none'")
            assert await tab.run(f"({hit})('take-over')")
        finally:
            rival.cancel()


async def test_the_words_name_what_this_device_has(scene, tab):
    async with scene.car(), scene.monitor():
        texts = "document.querySelector('.side').innerText + document.querySelector('#touch').ariaLabel"
        await watching(tab, scene)
        await take_control(tab)
        desk = await tab.run(texts)
        for word in ("Space or Esc", "an arrow key", "W A S D", "Autonomy (P)", "hold 1 s · R"):
            assert word in desk
        assert "LB" not in desk
        assert "{" not in desk
        await watching(tab, scene, "phone")
        await tab.run("document.querySelector('#drive').click()")
        await tab.until(f"{PILOT} === 'ready'")
        phone = await tab.run(texts)
        assert "hold the drive pad to drive, Autonomy to permit autonomy" in phone
        for word in ("arrow", "W A S D", "Space", " · ", "LB", "RB", "Start", "No gamepad"):
            assert word not in phone


CLEARS = "document.querySelector('#line-clears dd').textContent"
DESK = {
    "disarmed": "hold the drive pad or an arrow key to drive, or Autonomy (P) to permit autonomy",
    "armed": "a speed: pull the drive pad or hold an arrow key, or hold Autonomy (P)",
    "e-stopped": "switch Drive on, release everything, then hold Reset (R) for 1 s",
}
PHONE = {
    "disarmed": "hold the drive pad to drive, or Autonomy to permit autonomy",
    "armed": "a speed: pull the drive pad, or hold Autonomy",
    "e-stopped": "switch Drive on, release everything, then hold Reset for 1 s",
}


@pytest.mark.parametrize("words", [DESK, PHONE], ids=["desk", "phone"])
async def test_what_clears_a_state_names_what_this_device_has(scene, tab, words):
    async with scene.car() as car, scene.monitor():
        await watching(tab, scene, "phone" if words is PHONE else "desk")
        for state, clears in CLEARED_BY.items():
            car.condition = {"state": str(state), "reason": f"why {state}", "measure": None, "clears": clears}
            await tab.until(f"{CLEARS}.includes('why {state}') || {CLEARS} === {str(state)!r}")
            said = await tab.run(CLEARS)
            assert words.get(str(state), "") in said
            for wrong in ("Start", "push the stick", "wallride teleop"):
                assert wrong not in said
            assert words is DESK or not any(key in said for key in ("(R)", "(P)", "arrow"))
        car.e_stop.latch(Cause.OPERATOR, "e-stop by bob")
        await tab.until(f"{NEXT}.startsWith('E-stop: the car is held. Switch Drive on, then hold Reset')")
        assert ("(R)" in await tab.run(NEXT)) == (words is DESK)


async def test_a_human_whom_safety_does_not_bind_is_told_and_offered_the_switch(tab, car):
    assert await tab.run("document.querySelector('#overruled').hidden")
    car.overruled = {"speed_mps": 0.0, "reason": "braking: wall ahead", "measure": 0.4}
    await tab.until("!document.querySelector('#overruled').hidden")
    said = await tab.run("document.querySelector('#overruled-words').textContent")
    assert said == "Safety says “braking: wall ahead”. It does not bind you."
    await tab.click("#bind")
    await car.until(lambda: car.settings.settings.safety.binds_teleop, "safety binds")
    car.overruled = None
    await tab.until("document.querySelector('#overruled').hidden")


async def test_a_computer_without_sensors_and_a_mux_without_a_decision_are_said_plainly(tab, car):
    computer = "document.querySelector('#line-computer dd').textContent"
    await tab.until(f"{computer} === 'no temperature sensor here; no throttling reported'")
    car.computer = {"temperature_c": 51.4, "zone": "CPU-therm", "trouble": ""}
    await tab.until(f"{computer} === '51 °C (CPU-therm); no throttling reported'")
    car.computer = {**car.computer, "trouble": "the computer is slowed down (cpu): too hot, or a weak supply"}
    await tab.until(f"{computer} === '51 °C (CPU-therm); the computer is slowed down (cpu): too hot, or a weak supply'")
    car.computer = {}
    await tab.until(f"{computer} === 'not watched by this car'")
    await tab.until("document.querySelector('#output-winner').textContent !== '–'")
    assert "nobody" not in await tab.run("document.querySelector('#mux').innerText")


async def test_steering_is_in_degrees_and_no_number_is_bare(tab, car):
    plots = await tab.run("document.querySelector('#strips').innerText")
    assert "rad" not in plots
    await tab.until("document.querySelector('#strips').innerText.includes('7.2°')")  # 0.125 rad
    because = "import('./mux.js').then(({because}) => because({reason}, {measure}))"
    for reason, measure, words in (
        ("'boxed in'", "0.0", "boxed in"),
        ("'wall ahead'", "0.314", "wall ahead, 0.31 m free"),
        ("'the scan is too old'", "0.3", "the scan is too old, 0.30 s"),
    ):
        asked = because.replace("{reason}", reason).replace("{measure}", measure)
        assert await tab.run(asked) == words


async def test_no_number_is_minus_nothing(tab, car):
    for value, text in ((-0.0004, "0.000 m"), (-0.25, "−0.250 m"), (0.25, "0.250 m"), ("NaN", "–")):
        assert await tab.run(f"import('./look.js').then(({{number}}) => number({value}, 3, ' m'))") == text


async def test_ticks_are_not_rounded(tab, car):
    for low, high, labels in (
        (0, 0.25, ["0.250", "0.125", "0.000"]),
        (-0.1, 0.1, ["0.1", "0.0", "−0.1"]),
        (0, 5, ["5.0", "2.5", "0.0"]),
        (0, 200, ["200", "100", "0"]),
        (-0.25, 0.25, ["0.25", "0.00", "−0.25"]),
    ):
        found = f"import('./plots.js').then(({{tickLabels}}) => tickLabels({low}, {high}))"
        assert await tab.run(found) == labels
