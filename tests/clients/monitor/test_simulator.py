"""What a simulated car meets, changed from the page: offered only where a simulator answers beside the car."""

import json

import pytest

from tests.clients.monitor.operating import watching
from wallride.clients.monitor.messages import Ask, BadMessageError, read
from wallride.runtime.wire import topics
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.live_conditions import LiveConditions
from wallride.sim.live.scenes import WorldScene
from wallride.sim.scenario.conditions import Conditions
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world

SHOWN = "!document.querySelector('#simulator').hidden"


class Surface(WorldScene):
    """A scene that only remembers what was put into it."""

    def __init__(self):
        super().__init__(load_world("straight"), "left", LidarSettings(), None, 0)
        self.things = []

    def put(self, obstacle):
        self.things.append(obstacle)

    def clear(self):
        self.things.clear()


def test_a_page_may_ask_the_simulator_and_nothing_else_new():
    word = read('{"t": "ask", "id": 1, "what": "simulator", "question": {"do": "box"}}')
    assert isinstance(word, Ask)
    assert word.what == "simulator"
    with pytest.raises(BadMessageError):
        read('{"t": "ask", "id": 1, "what": "simulator/raw", "question": {}}')


async def test_a_box_is_put_before_a_simulated_car_from_the_page(scene, tab):
    surface = Surface()
    live = LiveConditions(Vehicle(), surface, Conditions())
    async with scene.car() as car, scene.monitor():
        car.bus.answer(topics.key("car1", topics.SIMULATOR), live.answer)
        await watching(tab, scene)
        await tab.until(SHOWN)
        await tab.run("document.querySelector('#simulator-actions button[data-action=box]').click()")
        await car.until(lambda: len(surface.things) == 1, "the box is there")
        await tab.run("document.querySelector('#simulator-actions button[data-action=grip_down]').click()")
        await tab.until("document.querySelector('#simulator-conditions').textContent.includes('grip 0.65')")
        words = await tab.run("document.querySelector('#simulator-actions button').textContent")
    assert words == "Put a box 1 m ahead now"


async def test_a_real_car_offers_nothing_of_the_kind(scene, tab):
    async with scene.car(), scene.monitor():
        await watching(tab, scene)
        answer = await tab.run("wallride.link.ask('simulator').then(() => 'answered', (error) => error.message)")
        assert "does not answer" in answer
        assert await tab.run(SHOWN) is False


def test_what_a_simulator_answers_is_one_small_message():
    live = LiveConditions(Vehicle(), Surface(), Conditions())
    told = json.loads(live.answer(b"{}"))
    assert set(told) == {"actions", "conditions", "done"}
    assert len(live.answer(b"{}")) < 4096
