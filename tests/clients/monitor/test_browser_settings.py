"""The settings panel in a real Chromium: it shows what the car has, in the words of `wallride param list`."""

import json

import pytest

from tests.clients.monitor.operating import watching
from wallride.clients.parameters import table


def field(name):
    return f"document.getElementById('setting-{name}')"


def trouble(name):
    return f"document.getElementById('setting-{name}-trouble').textContent"


NOTICE = "document.querySelector('#notice')"
DISTANCE = "wall_follow.desired_distance_m"


async def open_panel(tab):
    await tab.run("document.querySelector('#settings').open = true")
    await tab.until(f"Boolean({field(DISTANCE)})")


@pytest.fixture
async def car(tab, car):
    await open_panel(tab)
    return car


async def enter(tab, name, value):
    await tab.run(f"{field(name)}.value = {json.dumps(value)}; {field(name)}.dispatchEvent(new Event('change'))")


async def test_an_undo_that_the_car_refuses_shows_what_the_car_has_and_one_of_a_method_has_its_gains(tab, car):
    car.settings.set_some(json.dumps({"values": {"wall_follow.kp": 10.0}}).encode())
    await enter(tab, "wall_follow.method", "report")
    await car.until(lambda: car.settings.settings.wall_follow.method == "report", "set")
    await tab.until("document.querySelector('#settings-undo').textContent === 'Undo method'")
    car.standing = False
    await tab.click("#settings-undo")
    await tab.until(f"{NOTICE}.dataset.kind === 'bad' && {NOTICE}.textContent.includes('stands')")
    assert await tab.run(f"{field('wall_follow.method')}.value") == "report"
    assert car.settings.settings.wall_follow.method == "report"
    car.standing = True
    await tab.click("#settings-undo")
    await tab.until(f"{NOTICE}.textContent === 'wall_follow.method is ball again'")
    assert await tab.run(f"{field('wall_follow.method')}.value") == "ball"
    assert (car.settings.settings.wall_follow.method, car.settings.settings.wall_follow.kp) == ("ball", 10.0)
    assert await tab.run("document.querySelector('#settings-undo').disabled")


async def test_an_undo_leaves_what_another_has_set_since(tab, car):
    await enter(tab, "wall_follow.kp", "11")
    await car.until(lambda: car.settings.settings.wall_follow.kp == 11.0, "set")
    await tab.until("document.querySelector('#settings-undo').textContent === 'Undo kp'")
    car.settings.set_some(json.dumps({"values": {"wall_follow.kp": 12.25}}).encode())
    await tab.click("#settings-undo")
    await tab.until(f"{NOTICE}.textContent === 'wall_follow.kp was changed since, and is left as it is'")
    assert car.settings.settings.wall_follow.kp == 12.25
    assert await tab.run("document.querySelector('#settings-undo').disabled")


async def test_a_refusal_is_said_in_words_and_goes_when_a_valid_value_is_taken(tab, car):
    before = await tab.run(f"{field(DISTANCE)}.value")
    await enter(tab, DISTANCE, "-3")
    words = await tab.until(trouble(DISTANCE))
    assert "desired_distance_m" in words
    assert "-3" in words
    assert await tab.run(f"{field(DISTANCE)}.value") == before
    await tab.until(f"{NOTICE}.dataset.kind === 'bad' && {NOTICE}.textContent.includes('-3')")
    await enter(tab, DISTANCE, "0.8")
    await car.until(lambda: car.settings.settings.wall_follow.desired_distance_m == 0.8, "set")
    await tab.until(f"{trouble(DISTANCE)} === ''")
    await tab.until(f"{NOTICE}.textContent === ''", within_s=2)


async def test_a_value_that_is_set_elsewhere_is_shown(tab, car):
    await enter(tab, DISTANCE, "0.8")
    await car.until(lambda: car.settings.settings.wall_follow.desired_distance_m == 0.8, "set")
    car.settings.set_some(json.dumps({"values": {DISTANCE: 0.6}}).encode())
    await enter(tab, DISTANCE, "0.6")
    await tab.until(f"{field(DISTANCE)}.value === '0.6' && {trouble(DISTANCE)} === ''")


async def test_save_counts_what_the_car_has_not_saved(scene, tab):
    async with scene.car() as car, scene.monitor():
        car.settings.set_some(json.dumps({"values": {DISTANCE: 0.8}}).encode())
        await watching(tab, scene)
        await open_panel(tab)
        save = "document.querySelector('#settings-save')"
        await tab.until(f"{save}.textContent === 'Save 1 change' && !{save}.disabled")
        await tab.click("#settings-save")  # this car has no file
        await tab.until(f"{NOTICE}.textContent.includes('without a settings file')")
        assert await tab.run(f"{save}.textContent") == "Save 1 change"


async def test_every_setting_has_its_name_range_default_and_words_as_in_param_list(tab, car):
    rows = await tab.run(
        "[...document.querySelectorAll('.setting')].map((row) => ({name: row.querySelector('code').textContent,"
        " range: row.querySelector('.range').textContent, words: row.querySelector('.hint').textContent}))"
    )
    found = {row["name"]: row for row in rows}
    parameters = json.loads(car.settings.list_all(b""))["parameters"]
    live = [one for one in parameters if one["takes_effect"] != "restart" and one["type"] not in {"text", "list"}]
    assert list(found) == [one["name"] for one in live]
    for one in live:
        row, line = found[one["name"]], table([one])
        assert row["range"].startswith(one["range"])
        assert "default " in row["range"]
        assert one["description"]
        assert one["range"] in line
        assert line.endswith(row["words"])


async def test_no_two_settings_of_a_group_have_one_label(tab, car):
    rows = await tab.run(
        "[...document.querySelectorAll('.setting')].map((row) => [row.querySelector('code').textContent,"
        " row.querySelector('label').textContent])"
    )
    labels = [(name.rpartition(".")[0], label) for name, label in rows]
    assert len(set(labels)) == len(labels)
    assert dict(rows)["wall_follow.look_ahead_m"] == "look ahead distance"
    assert dict(rows)["wall_follow.look_ahead_s"] == "look ahead time"
    assert dict(rows)[DISTANCE] == "desired distance"


async def test_the_filter_finds_by_name_and_words_and_says_when_it_finds_nothing(tab, car):
    shown = "[...document.querySelectorAll('.setting')].filter((row) => row.checkVisibility()).length"
    search = "document.querySelector('#settings-filter')"
    typed = f"(text) => {{ {search}.value = text; {search}.dispatchEvent(new Event('input')); }}"
    await tab.run(f"({typed})('{DISTANCE}')")
    assert await tab.run(shown) == 1
    await tab.run(f"({typed})('xyzzy')")
    assert await tab.run(shown) == 0
    assert "No setting has “xyzzy”" in await tab.run("document.querySelector('#settings-none').textContent")
    await tab.run(f"({typed})('')")
    assert await tab.run(shown) > 5
    assert await tab.run("document.querySelector('#settings-none').textContent") == ""


async def test_one_click_goes_back_to_the_default(tab, car):
    default = car.settings.settings.wall_follow.desired_distance_m
    row = f"{field(DISTANCE)}.closest('.setting')"
    assert not await tab.run(f"{row}.querySelector('.quiet').checkVisibility()")
    await enter(tab, DISTANCE, "0.8")
    await car.until(lambda: car.settings.settings.wall_follow.desired_distance_m == 0.8, "set")
    await tab.until(f"{row}.querySelector('.quiet').checkVisibility()")
    assert await tab.run(f"{row}.querySelector('.quiet').textContent") == "reset to default"
    await tab.run(f"{row}.querySelector('.quiet').click()")
    await car.until(lambda: car.settings.settings.wall_follow.desired_distance_m == default, "back")
    await tab.until(f"!{row}.querySelector('.quiet').checkVisibility()")
