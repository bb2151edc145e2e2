"""Maps of laps at the monitor's door: who may have one made, and see it."""

import asyncio
import contextlib
import json

import aiohttp

from tests.clients.monitor.lap_commands import PNG, LapCommands, recorded
from tests.clients.monitor.operating import operate
from wallride.clients.monitor.outbox import TOPICS
from wallride.runtime.teleop.status import OperatorState

LAP_MAP = TOPICS.index("lap_map")


class LapPage:
    """A page as the server sees one: it watches car1."""

    def __init__(self, socket):
        self._socket = socket

    async def say(self, **word):
        await self._socket.send_str(json.dumps(word))

    async def until(self, wanted):
        """Return the first message of the server that is wanted: of text, or the fields of a map."""
        async with asyncio.timeout(10):
            async for message in self._socket:
                found = json.loads(message.data) if message.type is aiohttp.WSMsgType.TEXT else self._read(message.data)
                if message.type is aiohttp.WSMsgType.BINARY:
                    await self.say(t="ack", n=int.from_bytes(message.data[:4], "little"))
                if found is not None and wanted(found):
                    return found
        raise AssertionError("the server went away")

    def _read(self, bundle):
        at = 4
        while at < len(bundle):
            length = int.from_bytes(bundle[at + 4 : at + 8], "little")
            if bundle[at] == LAP_MAP:
                return json.loads(bundle[at + 8 : at + 8 + length])
            at += 8 + length + -length % 4
        return None


@contextlib.asynccontextmanager
async def watching(scene):
    address, origin = f"{scene.base}ws?token={scene.token}", {"Origin": scene.base.rstrip("/")}
    async with aiohttp.ClientSession() as session, session.ws_connect(address, headers=origin) as socket:
        page = LapPage(socket)
        await page.say(t="watch", car="car1")
        await page.until(lambda found: found.get("stage") == "none")
        yield page


async def refusal(page):
    return (await page.until(lambda found: found.get("t") == "trouble"))["reason"]


async def test_a_page_has_a_map_made_and_its_picture_is_for_those_with_the_token(scene, tmp_path):
    commands = LapCommands()
    async with scene.car() as car, scene.monitor(run=commands):
        car.recordings = recorded(tmp_path / "recordings")
        async with watching(scene) as page, aiohttp.ClientSession() as http:
            picture = f"{scene.base}lap-map/map.png"
            async with http.get(f"{picture}?token={scene.token}") as answer:
                assert answer.status == 404
            await page.say(t="map_lap", do="begin")
            made = await page.until(lambda found: found.get("stage") == "good" and not found["busy"])
            assert made["pictures"] == ["map", "line"]
            async with http.get(f"{picture}?token={scene.token}&number=1") as answer:
                assert (answer.status, answer.content_type, await answer.read()) == (200, "image/png", PNG)
            evil = {"Host": "evil.example"}
            for query, headers in (("", {}), ("?token=wrong", {}), (f"?token={scene.token}", evil)):
                async with http.get(f"{picture}{query}", headers=headers) as answer:
                    assert answer.status == 403
    assert commands.names == ["map", "line"]


async def test_a_car_that_drives_is_to_be_stopped_first(scene):
    commands = LapCommands()
    async with scene.car(permit="always", autonomy=True) as car, scene.monitor(run=commands), watching(scene) as page:
        await car.until(lambda: car.speed_mps > 0.3, "it drives")
        await asyncio.sleep(0.2)  # until the status says so
        await page.say(t="map_lap", do="begin")
        assert await refusal(page) == "car1 drives: stop it first"
    assert commands.words == []


async def test_a_car_of_another_operator_is_left_alone(scene):
    commands = LapCommands()
    async with scene.car() as car, scene.monitor(run=commands), watching(scene) as page:
        await car.until(lambda: car.beat is not None, "a heartbeat")
        rival = asyncio.create_task(operate(car))
        await car.until(lambda: car.desk.view().standing is OperatorState.MANUAL, "it is operated")
        await asyncio.sleep(0.2)  # until the heartbeat says so
        await page.say(t="map_lap", do="begin")
        assert await refusal(page) == "another operator has car1: take over first"
        rival.cancel()
    assert commands.words == []


async def test_what_is_no_word_about_a_map_begins_none(scene, tmp_path):
    commands = LapCommands()
    async with scene.car() as car, scene.monitor(run=commands):
        car.recordings = recorded(tmp_path / "recordings")
        async with watching(scene) as page:
            await page.say(t="map_lap", do="begin", file="/etc/passwd")
            await page.say(t="map_lap", do="delete")
            await page.say(t="ping", at=1)
            await page.until(lambda found: found.get("t") == "pong")
    assert commands.words == []
