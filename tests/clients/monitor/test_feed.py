"""One start of one car for all pages: another start at the same address is not shown, and is told nothing."""

import asyncio
import contextlib
import time

import pytest

from tests.clients.monitor.fake_car import FakeCar
from tests.waiting import until
from wallride.clients.monitor.feed import PageFeed
from wallride.clients.monitor.relay import CarEndpoint, Relay
from wallride.runtime.wire import zenoh_config
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.teleop import Command, Input, Press


class Page:
    def __init__(self):
        self.taken, self.beats = [], []

    def take(self, topic, payload, arrival_s):
        self.taken.append(topic)

    def hear(self, beat, payload, arrival_s):
        self.beats.append(beat.car_session)


@contextlib.asynccontextmanager
async def fed(endpoint, session):
    feed, page = PageFeed("car1", zenoh_config.client_config(endpoint, None), session), Page()
    feed.watchers.add(page)
    running = asyncio.create_task(feed.run())
    try:
        yield feed, page
    finally:
        running.cancel()
        await asyncio.wait([running])


async def test_the_car_that_is_meant_is_shown_and_answers(scene):
    async with FakeCar(scene.endpoint, car_session=0xCAFE), fed(scene.endpoint, 0xCAFE) as (feed, page):
        await until(lambda: len(page.taken) > 5 and page.beats)
        assert set(page.beats) == {0xCAFE}
        assert (await feed.ask("param/get", {"names": ["car.name"]}))["values"] == {"car.name": "car1"}
        assert feed.problem == ""


async def test_another_one_at_its_address_is_named_not_shown_and_told_nothing(scene):
    async with FakeCar(scene.endpoint, car_session=0xBEEF) as car, fed(scene.endpoint, 0xCAFE) as (feed, page):
        await until(lambda: "0000beef" in feed.problem)
        await asyncio.sleep(0.2)
        assert (page.taken, page.beats) == ([], [])
        feed.send(Command(7, 1, 0xBEEF, 1, Press.ESTOP, Input.PAGE))
        with pytest.raises(RefusedError, match="is not the one that was meant"):
            await feed.ask("param/set", {"values": {"wall_follow.speed_mps": 3.0}})
        await asyncio.sleep(0.2)
        assert car.applied == []
        assert not car.e_stop.causes


async def test_a_page_that_comes_later_has_the_plots_of_before(scene):
    relay = Relay([CarEndpoint(scene.endpoint, zenoh_config.client_config(scene.endpoint, None))])
    running = asyncio.create_task(relay.run())
    try:
        async with FakeCar(scene.endpoint):
            await asyncio.sleep(2.0)
            feed = relay.watch("car1", Page())
            ages_ms = feed.history.fields(time.monotonic())["error"]["age_ms"]
            assert max(ages_ms, default=0) > 500
    finally:
        running.cancel()
        await asyncio.wait([running])
