"""The web server: what it serves, whom it turns away, and that pages do not wait for each other."""

import asyncio
import contextlib
import json
import struct
import time

import aiohttp
import pytest

from tests.promises import promise
from wallride.clients.door import door as the_door
from wallride.clients.fleet.cars import UNREADABLE
from wallride.clients.fleet.race import RaceControl
from wallride.clients.monitor import server
from wallride.clients.monitor.outbox import TOPICS
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.zenoh_config import client_config


def number_of(bundle):
    return struct.unpack_from("<I", bundle)[0]


async def hello(socket):
    return json.loads((await socket.receive(timeout=5)).data)


async def bundles(socket, count, *, answer=True):
    """Return so many bundles; acknowledges them unless told otherwise."""
    found = []
    while len(found) < count:
        message = await socket.receive(timeout=5)
        if message.type is aiohttp.WSMsgType.BINARY:
            found.append(message.data)
            if answer:
                await socket.send_str(json.dumps({"t": "ack", "n": number_of(message.data)}))
    return found


@pytest.fixture
async def http():
    async with aiohttp.ClientSession() as session:
        yield session


def connect(http, scene, **headers):
    address = f"{scene.base}ws?token={scene.token}"
    return http.ws_connect(address, headers={"Origin": scene.base.rstrip("/"), **headers})


def test_every_file_that_the_page_names_is_in_the_package():
    files = server.read_all()
    text = "".join(asset.body.decode() for asset in files.values())
    assert {"index.html", "style.css", "main.js", "icon.svg"} <= files.keys()
    for name in files.keys() - {"index.html"}:
        assert name in text, f"nobody asks for {name}"
    index = files["index.html"].body.decode()
    assert [name for name in files if name.endswith(".js") and f'modulepreload" href="{name}"' not in index] == []
    for word in ("https://", "//cdn", "@import", "eval("):
        assert word not in text


async def test_the_page_comes_with_headers_that_keep_it_to_itself(scene, http):
    async with scene.monitor():
        async with http.get(scene.url) as answer:
            assert answer.status == 200
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
            assert answer.headers["Referrer-Policy"] == "no-referrer"
        for path in ("..%2f..%2fetc%2fpasswd", "server.py", "page/index.html", "%00"):
            async with http.get(scene.base + path) as answer:
                assert answer.status == 404


async def test_other_sites_stay_outside(scene, http):
    async with scene.monitor():
        async with http.get(scene.url, headers={"Host": "evil.example"}) as answer:
            assert answer.status == 403
        for headers in ({"Origin": "http://evil.example"}, {"Origin": ""}, {"Host": "evil.example"}):
            with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                await connect(http, scene, **headers)


@pytest.mark.parametrize("address", ["127.0.0.1", "0.0.0.0"])
async def test_the_address_has_a_token_for_other_users_of_this_machine_too(scene, http, address):
    async with scene.monitor(address=address):
        base, _, token = scene.url.partition("?token=")
        assert len(token) >= 16
        assert "0.0.0.0" not in base
        for url, status in ((base, 403), (f"{base}?token=wrong", 403), (scene.url, 200), (f"{base}main.js", 200)):
            async with http.get(url) as answer:
                assert answer.status == status
        origin = {"Origin": base.rstrip("/")}
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await http.ws_connect(f"{base}ws", headers=origin)
        async with http.ws_connect(f"{base}ws?token={token}", headers=origin) as socket:
            assert (await hello(socket))["topics"] == list(TOPICS)


async def test_one_bundle_is_on_its_way_and_a_late_page_does_not_slow_another(scene, http):
    async with scene.car(), scene.monitor(), connect(http, scene) as late, connect(http, scene) as quick:
        for socket in (late, quick):
            await hello(socket)
            await socket.send_str('{"t":"watch","car":"car1"}')
        await bundles(late, 1, answer=False)
        started_s = time.monotonic()
        found = await bundles(quick, 40)
        promise("40 bundles beside a late page", time.monotonic() - started_s, 4.0)
        numbers = [number_of(bundle) for bundle in found]
        assert numbers == list(range(numbers[0], numbers[0] + 40))
        with pytest.raises(TimeoutError):
            await late.receive(timeout=0.5)


async def test_what_is_no_word_is_ignored_and_a_stop_still_stops(scene, http):
    async with scene.car() as car, scene.monitor(), connect(http, scene) as socket:
        await hello(socket)
        await socket.send_str('{"t":"watch","car":"car1"}')
        await bundles(socket, 2)
        for text in ("", "{}", "[1]", '{"t":"hands"}', '{"t":"ask","id":1,"what":"operator/command"}'):
            await socket.send_str(text)
        await socket.send_str('{"t":"stop"}')
        await car.until(lambda: car.e_stop.latched, "stopped")


async def test_questions_are_answered_or_refused_in_words(scene, http):
    async with scene.car(), scene.monitor(), connect(http, scene) as socket:
        await hello(socket)

        async def ask(number, what, question):
            await socket.send_str(json.dumps({"t": "ask", "id": number, "what": what, "question": question}))
            while True:
                message = await socket.receive(timeout=5)
                if message.type is aiohttp.WSMsgType.TEXT and (found := json.loads(message.data)).get("id") == number:
                    return found

        assert "no car" in (await ask(1, "param/list", {}))["refused"]
        await socket.send_str('{"t":"watch","car":"car1"}')
        await bundles(socket, 3)
        assert (await ask(2, "param/get", {"names": ["car.name"]}))["answer"] == {"values": {"car.name": "car1"}}
        assert "not a setting" in (await ask(3, "param/set", {"values": {"no.such": 1}}))["refused"]
        assert (await ask(4, "record", {"on": True}))["answer"] == {"on": True}


async def test_the_monitor_waits_for_a_car_that_is_not_there_yet(scene, http):
    async with scene.monitor(), connect(http, scene) as socket:
        first = await hello(socket)
        assert first["cars"] == []
        assert scene.endpoint in first["problem"]
        async with scene.car():
            await socket.send_str('{"t":"watch","car":"car1"}')
            async with asyncio.timeout(10):
                while True:
                    (bundle,) = await bundles(socket, 1)
                    if bundle[4] == TOPICS.index(topics.SCAN) or len(bundle) > 4000:
                        return


async def test_refused_sockets_fill_no_log(scene, http, caplog):
    async with scene.monitor():
        for _ in range(100):
            with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                await connect(http, scene, Origin="http://" + "x" * 2000)
    said = [record for record in caplog.records if "turned away" in record.getMessage()]
    assert 1 <= len(said) <= 5
    assert all(len(record.getMessage()) < 400 and record.getMessage().isprintable() for record in said)


async def test_nonsense_of_a_page_fills_no_log(scene, http, caplog):
    async with scene.monitor(), connect(http, scene) as socket:
        await hello(socket)
        for _ in range(200):
            await socket.send_str("{" + "x" * 500)
        await socket.send_str('{"t":"ping","at":1}')
        while json.loads((await socket.receive(timeout=5)).data).get("t") != "pong":
            pass
    said = [record for record in caplog.records if "is no word" in record.getMessage()]
    assert 1 <= len(said) <= 5


async def half_request(scene):
    reader, writer = await asyncio.open_connection("127.0.0.1", scene.port)
    writer.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
    return reader, writer


async def test_half_a_request_is_not_waited_for(scene, http, monkeypatch):
    monkeypatch.setattr(the_door, "IDLE_S", 1.0)
    async with scene.car(), scene.monitor(), connect(http, scene) as socket:
        await hello(socket)
        halves = [await half_request(scene) for _ in range(20)]
        async with asyncio.timeout(10):
            for reader, writer in halves:
                with contextlib.suppress(ConnectionError):
                    assert await reader.read() == b""
                writer.close()
        await socket.send_str('{"t":"watch","car":"car1"}')
        assert await bundles(socket, 2), "a page with the token stays"


async def test_too_many_connections_end_the_oldest(scene, http, monkeypatch):
    monkeypatch.setattr(the_door, "MAX_CONNECTIONS", 5)
    async with scene.monitor():
        halves = [await half_request(scene) for _ in range(20)]
        async with asyncio.timeout(5):
            for reader, _ in halves[:10]:
                with contextlib.suppress(ConnectionError):
                    assert await reader.read() == b""
        for _, writer in halves:
            writer.close()
        async with http.get(scene.url) as answer:
            assert answer.status == 200


async def test_garbage_on_the_port_is_not_logged(scene, caplog):
    async with scene.monitor():
        for garbage in (b"\x16\x03\x01" + bytes(200), b"GET / HTTP/9.9\r\n\r\n", b"\xff" * 70_000):
            reader, writer = await asyncio.open_connection("127.0.0.1", scene.port)
            writer.write(garbage)
            with contextlib.suppress(ConnectionError, TimeoutError):
                async with asyncio.timeout(2):
                    await reader.read()
            writer.close()
    assert not [record for record in caplog.records if record.name.startswith(("aiohttp", "wallride.monitor"))]


async def fleet_shown(socket):
    """Return what the page is shown of all cars in the next bundle that has it."""
    while True:
        (bundle,) = await bundles(socket, 1)
        if (at := bundle.find(b'{"cars"')) >= 0:
            return json.JSONDecoder().raw_decode(bundle[at:].decode(errors="replace"))[0]


@pytest.mark.parametrize("checked", [True, False])
async def test_whatever_a_car_publishes_stop_all_works_on_a_page_opened_afterwards(scene, http, monkeypatch, checked):
    if not checked:  # what the check of the shape may have overlooked
        monkeypatch.setattr("wallride.clients.fleet.cars.check_status", lambda _status: None)
    odd, key = Bus(client_config(scene.endpoint, None)), topics.key("odd", topics.STATUS)
    async with scene.car() as car, scene.monitor(), connect(http, scene) as page, connect(http, scene) as late:
        await odd.open()
        odd.announce(topics.key("odd", topics.ALIVE))
        await hello(page)
        await page.send_str('{"t":"all"}')
        rows = {}
        while rows.get("odd", {}).get("trouble") != UNREADABLE:
            odd.put(key, b'{"gates": 3}')
            rows = {row["car"]: row for row in (await fleet_shown(page))["cars"]}
        assert rows["car1"]["trouble"] == ""
        await hello(late)
        await late.send_str('{"t":"all"}')
        await late.send_str('{"t":"stop_all"}')
        await car.until(lambda: car.e_stop.latched, "stopped")
        await odd.close()


async def test_where_the_cars_cannot_be_shown_the_page_says_so_and_stop_all_works(scene, http, monkeypatch):
    monkeypatch.setattr(RaceControl, "standings", lambda *_: 1 / 0)
    async with scene.car() as car, scene.monitor(), connect(http, scene) as page:
        await hello(page)
        await page.send_str('{"t":"all"}')
        assert "the cars cannot be shown" in (await fleet_shown(page))["problems"][0]
        await page.send_str('{"t":"stop_all"}')
        await car.until(lambda: car.e_stop.latched, "stopped")


async def test_a_page_whose_helper_fails_is_disconnected_and_not_frozen(scene, http, monkeypatch, caplog):
    monkeypatch.setattr("wallride.clients.monitor.session.PageSession._show_pilot", lambda *_: 1 / 0)
    async with scene.monitor(), connect(http, scene) as page:
        await hello(page)
        async with asyncio.timeout(5):
            async for _ in page:
                pass
        assert page.close_code == aiohttp.WSCloseCode.INTERNAL_ERROR
    assert "a page is disconnected: ZeroDivisionError" in caplog.text
