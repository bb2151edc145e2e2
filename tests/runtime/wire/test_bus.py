"""The zenoh session on loopback: heard, asked, watched; out of the way when its port is taken, silent when closed."""

import asyncio
import itertools
import socket
import threading
import time
from types import SimpleNamespace

import pytest

from tests.runtime.wire.loopback import KEY, both, car_config, client_of, connected
from tests.waiting import until
from wallride.runtime.wire import zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.mailbox import MAX_DELIVERIES, Mailbox, PromptMailbox
from wallride.runtime.wire.network import PortTakenError, RefusedError
from wallride.runtime.wire.ports import free_endpoint


@pytest.fixture
async def pair():
    """A car and a client, both open; bursts are tested here."""
    car, client = both(limits=False)
    await car.open()
    await client.open()
    yield car, client
    await client.close()
    await car.close()


@pytest.fixture
def taken():
    """The address of a port that another program has."""
    with socket.create_server(("127.0.0.1", 0)) as owner:
        yield f"tcp/127.0.0.1:{owner.getsockname()[1]}"


async def test_a_subscriber_hears_everything_in_order_and_when_it_came(pair):
    car, client = pair
    heard = []
    car.subscribe(KEY, lambda key, payload, arrival_s: heard.append((key, payload, arrival_s)))
    await connected(client)
    before_s = time.monotonic()
    for i in range(50):
        client.put(KEY, bytes([i]), encoding="application/octet-stream", urgent=True)
    await until(lambda: len(heard) == 50)
    assert [payload[0] for _, payload, _ in heard] == list(range(50))
    assert all(key == KEY and before_s <= arrival_s <= time.monotonic() for key, _, arrival_s in heard)


async def test_a_put_on_a_wildcard_does_not_reach_an_exact_subscription(pair):
    car, client = pair
    heard = []
    car.subscribe(KEY, lambda key, payload, arrival_s: heard.append(payload))
    await connected(client)
    for wild in ("wallride/*/operator/command", "wallride/**", "**"):
        client.put(wild, b"wild")
    client.put(KEY, b"exact")
    await until(lambda: heard)
    await until(lambda: car.strays == 3)
    assert heard == [b"exact"]


async def test_a_question_is_answered_refused_or_met_with_silence(pair):
    car, client = pair

    def reply(payload):
        if payload == b"bad":
            raise RefusedError("no such thing")
        return b"yes " + payload

    async def slow(payload):
        await asyncio.sleep(0)
        return b"slowly"

    car.answer("wallride/car1/param/get", reply)
    car.answer("wallride/car1/param/save", slow)
    async with asyncio.timeout(10):
        while not await client.ask("wallride/car1/param/save"):
            await asyncio.sleep(0.01)
    assert await client.ask("wallride/car1/param/get", b"kp") == [b"yes kp"]
    assert await client.ask("wallride/car1/param/save") == [b"slowly"]
    with pytest.raises(RefusedError, match="no such thing"):
        await client.ask("wallride/car1/param/get", b"bad")
    with pytest.raises(RefusedError, match=r"ask wallride/car1/param/\w+ itself"):
        await client.ask("wallride/**")
    assert await client.ask("wallride/car1/nobody") == []


async def test_a_token_is_seen_to_come_and_to_go(pair):
    car, client = pair
    seen = []
    client.watch("wallride/*/alive", lambda key, alive: seen.append((key, alive)))
    car.announce("wallride/car1/alive")
    await until(lambda: seen == [("wallride/car1/alive", True)])
    await car.close()
    await until(lambda: seen[-1] == ("wallride/car1/alive", False))


async def test_what_is_declared_before_it_opens_holds_afterwards_and_what_is_put_is_counted_as_lost():
    (car, client), heard = both(), []
    car.subscribe(KEY, lambda key, payload, arrival_s: heard.append(payload))
    car.put(KEY, b"too early")
    assert car.dropped == 1
    assert not car.wanted(KEY)
    await car.open()
    await client.open()
    await connected(client)
    client.put(KEY, b"now")
    await until(lambda: heard == [b"now"])
    await client.close()
    await car.close()
    car.put(KEY, b"too late")
    assert car.dropped == 2


async def test_it_is_closed_once_no_thread_is_left_that_calls_it():
    car, client = both()
    before = set(threading.enumerate())
    await car.open()
    await client.open()
    for bus in (car, client):
        bus.subscribe(KEY, lambda *_: None)
        bus.watch("wallride/*/alive", lambda *_: None)
        bus.answer(f"wallride/{id(bus)}/param/get", lambda _: b"{}")
    await client.ask(f"wallride/{id(car)}/param/get", timeout_s=0.2)
    callers = [one for one in threading.enumerate() if one not in before and "closure" in one.name]
    assert len(callers) >= 6
    late = threading.Thread(target=time.sleep, args=(0.1,), name="late")
    late.start()
    client._callers.append(late)
    await client.close()
    await car.close()
    assert not [one for one in (*callers, late) if one.is_alive()]


async def test_a_burst_beyond_the_backlog_keeps_the_newest(pair):
    car, client = pair
    heard = []
    car.subscribe(KEY, lambda key, payload, arrival_s: heard.append(int(payload)))
    await connected(client)
    for i in range(1000):
        client.put(KEY, str(i).encode())
    client.put(KEY, b"1000")
    time.sleep(1.0)  # the loop is blocked, as in a stall, and zenoh's threads are not: the burst piles up behind it
    await until(lambda: heard and heard[-1] == 1000)
    assert heard == sorted(heard)
    assert len(heard) <= 257


@pytest.mark.parametrize("kind", [Mailbox, PromptMailbox])
async def test_a_flood_leaves_the_loop_its_turns(kind):
    """zenoh's threads may refill a mailbox faster than it is emptied; whatever else is due must run in between."""
    loop = asyncio.get_running_loop()
    flooded, turns = [], []

    def deliver(number):
        flooded.append(number)
        if len(turns) < 10:
            mailbox.post((number + 1,))

    mailbox = kind(loop, deliver)

    def turn():
        turns.append(len(flooded))
        if len(turns) < 10:
            loop.call_soon(turn)

    mailbox.post((0,))
    loop.call_soon(turn)
    await until(lambda: len(turns) == 10)
    assert max(after - before for before, after in itertools.pairwise(turns)) <= MAX_DELIVERIES
    assert flooded == list(range(len(flooded)))
    if kind is PromptMailbox:
        mailbox.close()


@pytest.mark.parametrize("kind", [Mailbox, PromptMailbox])
async def test_a_receiver_that_raises_loses_its_message_and_not_the_subscription(kind):
    loop, delivered, raised = asyncio.get_running_loop(), [], []
    loop.set_exception_handler(lambda _loop, context: raised.append(context["exception"]))

    def deliver(number):
        if number == 1:
            raise AttributeError("odd")
        delivered.append(number)

    mailbox = kind(loop, deliver)
    for number in range(3):
        mailbox.post((number,))
    await until(lambda: delivered == [0, 2])
    mailbox.post((3,))
    await until(lambda: delivered == [0, 2, 3])
    assert [str(error) for error in raised] == ["odd"]
    if kind is PromptMailbox:
        mailbox.close()
        mailbox.post((4,))
        await asyncio.sleep(0)
        assert delivered == [0, 2, 3]


async def test_what_is_too_large_is_dropped_before_it_is_copied(pair):
    car, client = pair
    heard = []
    car.subscribe(KEY, lambda key, payload, arrival_s: heard.append(payload), max_bytes=40)
    car.answer("wallride/car1/param/get", lambda payload: b"yes")
    await connected(client)
    client.put(KEY, b"x" * 60)
    await asyncio.sleep(0.05)
    client.put(KEY, b"x" * 40)
    await until(lambda: heard)
    assert [len(payload) for payload in heard] == [40]
    with pytest.raises(RefusedError, match="longer than 4096 bytes"):
        await client.ask("wallride/car1/param/get", b"x" * 4097)
    assert car.oversized == 1


async def test_a_taken_port_is_left_to_its_owner_and_said(taken):
    bus = Bus(car_config(taken))
    with pytest.raises(PortTakenError, match=taken) as caught:
        await bus.open()
    assert caught.value.endpoint == taken
    assert not bus.is_open
    await bus.close()


async def test_where_any_port_will_do_a_taken_one_is_replaced(taken):
    bus = Bus(car_config(taken), any_port=True)
    await bus.open()
    assert bus.is_open
    assert bus.endpoint != taken
    await bus.close()


async def test_an_address_that_this_machine_does_not_have_is_no_taken_port():
    bus = Bus(zenoh_config.client_config(free_endpoint(), None) | {"listen": {"endpoints": ["tcp/192.0.2.1:7447"]}})
    with pytest.raises(OSError, match=r"192\.0\.2\.1") as caught:
        await bus.open()
    assert not isinstance(caught.value, PortTakenError)


def test_a_session_without_an_address_has_none():
    assert Bus({}).endpoint == ""


async def test_a_client_without_a_car_is_told_so():
    with pytest.raises(OSError, match="onnect"):
        await client_of(free_endpoint()).open()


async def test_a_session_that_does_not_close_is_left(monkeypatch, caplog):
    never = threading.Event()
    monkeypatch.setattr("wallride.runtime.wire.bus.CLOSES_WITHIN_S", 0.02)
    bus = client_of("tcp/127.0.0.1:1")
    monkeypatch.setattr(bus, "_session", SimpleNamespace(close=never.wait))
    await bus.close()
    assert "does not close" in caplog.text
    assert not bus.is_open
    never.set()


async def test_a_clock_after_zenohs_last_year_opens_no_session(monkeypatch):
    monkeypatch.setattr("wallride.runtime.wire.bus.time.time", lambda: 4.9e9)  # 2125
    with pytest.raises(OSError, match="clock is after 2106"):
        await client_of("tcp/127.0.0.1:1").open()
