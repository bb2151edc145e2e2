"""One page, from its first byte to its last: reads its messages, sends it new data, keeps its deadman."""

import asyncio
import json
import logging
import time
from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from wallride.clients.door.door import shortened
from wallride.clients.monitor import messages
from wallride.clients.monitor.calibration import PageCalibrator
from wallride.clients.monitor.command_run import RunCommand, run_command
from wallride.clients.monitor.driving import PageDriver
from wallride.clients.monitor.feed import PageFeed
from wallride.clients.monitor.lap_mapper import LapMapper, LapSource
from wallride.clients.monitor.messages import (
    Ack,
    Ask,
    BadMessageError,
    Calibrate,
    Drop,
    InputState,
    Leave,
    LookAtAll,
    MapLap,
    NewRace,
    PageMessage,
    Ping,
    StopAll,
    StopMessage,
    Watch,
)
from wallride.clients.monitor.outbox import CALIBRATION, FLEET, FROM_CAR, LAP_MAP, MONITOR, PILOT, TOPICS, Outbox, pack
from wallride.clients.monitor.overview import CarsOverview
from wallride.clients.monitor.relay import Relay
from wallride.clients.remote.car import connect
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.ending import end
from wallride.runtime.host.rate_limited_log import RateLimitedLog
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.teleop import Beat, Command

log = logging.getLogger("wallride.monitor")

TICK_S = 0.02
TICKS_PER_VIEW = 5
TICKS_PER_ALL = 10
TICKS_PER_NEWS = 25
LAST_WORDS_APART_S = 0.005
BEATS_AHEAD = 25
"""Maximum number of beats in transit to a page that drives: half a second of them, more than is useful."""
CALIBRATING = {
    "engaged": True, "mood": "yellow", "state": "calibrating",
    "next": "Hold {manual}: the car drives the step by itself. Let go, and it stops.",
}  # fmt: skip
FAILED = b"The monitor failed to show this page; its log says why."
MAX_QUESTIONS = 4
"""Maximum number of simultaneous queries of one page."""


@dataclass(frozen=True, slots=True)
class Host:
    """Data shared by all sessions.

    car: the one to show first, "" for any. name: whom cars and other operators see. drivers: of all pages.
    farewell: file with the sentence that pages show once the server has ended, None for the usual one.
    keys: folder of the keys, for tls. config: settings file of the car, where calibrated values and maps are written.
    run: how commands of `wallride` are run.
    """

    relay: Relay
    name: str
    feel: InputShape
    version: str
    car: str = ""
    drivers: set[PageDriver] = field(default_factory=set)
    farewell: Path | None = None
    keys: Path | None = None
    config: Path | None = None
    run: RunCommand = run_command
    overview: CarsOverview = field(init=False)
    mapper: LapMapper = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "overview", CarsOverview(self.relay.links, self.name))
        object.__setattr__(self, "mapper", LapMapper(self.config, self.run))


class PageSession:
    """A page and its WebSocket. malformed: number of invalid messages."""

    def __init__(self, socket: web.WebSocketResponse, host: Host) -> None:
        self._socket = socket
        self._host = host
        self._outbox = Outbox()
        self._news = asyncio.Event()
        self._feed: PageFeed | None = None
        self._driver = PageDriver(host.name, host.feel)
        self._calibrator = PageCalibrator(host.config)
        self._shown: dict[str, bytes] = {}
        self._asking: set[asyncio.Task[None]] = set()
        self._beats_ahead = 0
        self._shows_all = False
        self._urgent: list[bytes] = []
        self._refusals = RateLimitedLog(log, time.monotonic)
        self.malformed = 0

    async def run(self) -> None:
        """Serve the page until it disconnects, in any way."""
        self._host.drivers.add(self._driver)
        await self._socket.send_str(json.dumps(self._hello()))
        jobs = (self._send_for_ever(), self._tick_for_ever())
        helpers = [asyncio.create_task(self._or_close(job)) for job in jobs]
        try:
            async for message in self._socket:
                if message.type is not WSMsgType.TEXT:
                    break
                await self._receive(message.data)
        finally:
            await self._end([*helpers, *self._asking])

    def take(self, topic: str, payload: bytes, arrival_s: float) -> None:
        """Take a sample from the feed."""
        self._outbox.put(topic, payload, arrival_s)
        self._news.set()

    def hear(self, beat: Beat, payload: bytes, arrival_s: float) -> None:
        """Take a heartbeat from the feed. A page that drives gets it at once: the car's patience counts from it."""
        self._driver.hear(beat, arrival_s)
        self._calibrator.hear(beat, arrival_s)
        if (self._driver.engaged or self._calibrator.takes_hands) and self._beats_ahead < BEATS_AHEAD:
            self._beats_ahead += 1
            self._urgent.append(pack(0, {topics.BEAT: (payload, arrival_s)}, arrival_s))
            self._news.set()
        else:
            self.take(topics.BEAT, payload, arrival_s)

    def _hello(self) -> dict[str, Any]:
        return {
            "t": "hello",
            "topics": TOPICS,
            "from_car": FROM_CAR,
            "version": self._host.version,
            "name": self._host.name,
            "car": self._host.car,
            "top_speed_mps": self._host.feel.max_speed_mps,
            **self._present(),
        }

    def _present(self) -> dict[str, Any]:
        """Return the state of the monitor itself; resent twice a second."""
        relay, feed = self._host.relay, self._feed
        return {
            "cars": relay.names,
            "problem": relay.problem,
            "watching": feed.car if feed is not None else "",
            "here": feed is not None and feed.car in relay.names,
            "link_problem": feed.problem if feed is not None else "",
            "recording": feed is not None and feed.is_recording,
            "round_trip_s": feed.round_trip_s if feed is not None else None,
            "replaced": self._outbox.replaced,
        }

    async def _receive(self, text: str) -> None:
        self._beats_ahead = 0
        now_s = time.monotonic()
        try:
            word = messages.read(text)
        except BadMessageError as error:
            self.malformed += 1
            self._refusals.log("malformed", f"a page said something that is no word: {shortened(str(error))}")
            return
        match word:
            case Ack(n=number):
                self._outbox.acknowledge(number)
                self._news.set()
            case Watch(car=car):
                await self._watch(car)
            case Ping(at=at):
                await self._socket.send_str(json.dumps({"t": "pong", "at": at}))
            case Ask():
                self._ask(word)
            case MapLap():
                await self._map_lap(word)
            case StopAll() | NewRace() | LookAtAll():
                await self._receive_about_all(word, now_s)
            case _:
                await self._receive_hands(word, now_s)

    async def _receive_hands(self, word: PageMessage, now_s: float) -> None:
        calibrator = self._calibrator
        match word:
            case InputState():
                if not calibrator.take_input(word, now_s):
                    self._send([self._driver.take_input(word, now_s)])
            case StopMessage():
                calibrator.end("STOP: the calibration has ended; nothing was written.")
                self._send([self._driver.stop(now_s)])
                self._show_pilot(now_s)
            case Drop():
                calibrator.lose()
                self._send([command for command in [self._driver.drop(now_s)] if command is not None])
            case Leave(deliberate=deliberate):
                await self._leave(deliberate=deliberate)
            case Calibrate():
                await self._calibrate(word)

    async def _receive_about_all(self, word: PageMessage, now_s: float) -> None:
        match word:
            case StopAll():
                self._host.overview.stop(now_s)
                self._show_all(now_s)
            case NewRace():
                self._host.overview.race.begin()
            case LookAtAll():
                await self._leave(deliberate=False)
                self._unwatch()
                self._driver.forget_car()
                self._shows_all = True
                self._show_all(now_s)

    async def _calibrate(self, word: Calibrate) -> None:
        feed, host = self._feed, self._host
        if feed is None:
            return
        if word.do == "drive":
            await self._leave(deliberate=True)
        place = host.relay.place_of(feed.car)
        self._calibrator.receive(
            word,
            lambda: connect(feed.car, at=place.endpoint, keys=host.keys, session=place.session, name=host.name),
        )

    async def _map_lap(self, word: MapLap) -> None:
        feed, host = self._feed, self._host
        if feed is None:
            return
        is_elsewhere = self._driver.whose(host.drivers) == "elsewhere"
        objection = f"another operator has {feed.car}: take over first" if is_elsewhere else ""
        options = host.relay.place_of(feed.car).options(host.keys)
        try:
            source = LapSource(feed.car, feed.ask, options, objection or feed.why_not_standing(time.monotonic()))
            host.mapper.receive(word, source)
        except RefusedError as error:
            await self._socket.send_str(json.dumps({"t": "trouble", "reason": str(error)}))

    async def _watch(self, car: str) -> None:
        self._shows_all = False
        if self._feed is not None and self._feed.car == car:
            return
        await self._leave(deliberate=False)
        self._unwatch()
        self._driver.forget_car()
        try:
            self._feed = self._host.relay.watch(car, self)
        except RefusedError as error:
            await self._socket.send_str(json.dumps({"t": "trouble", "reason": str(error)}))
        else:
            self._driver.by_keys = self._feed.is_by_keys
            lines = self._feed.history.fields(time.monotonic())
            await self._socket.send_str(json.dumps({"t": "history", "car": car, "lines": lines}))
        self._show_monitor()

    def _unwatch(self) -> None:
        self._calibrator.forget()
        if self._feed is not None:
            self._host.relay.unwatch(self._feed, self)
            self._feed = None
            self._outbox.clear()
            self._urgent.clear()
            self._shown.clear()

    def _send(self, commands: Sequence[Command]) -> None:
        if self._feed is not None:
            for command in commands:
                self._feed.send(command)

    async def _leave(self, *, deliberate: bool) -> None:
        self._calibrator.leave()
        for command in self._driver.leave(time.monotonic(), deliberate=deliberate):
            self._send([command])
            await asyncio.sleep(LAST_WORDS_APART_S)

    def _ask(self, word: Ask) -> None:
        if len(self._asking) >= MAX_QUESTIONS:
            task = asyncio.create_task(self._answer(word.id, {"refused": "too many questions at once; try again"}))
        else:
            task = asyncio.create_task(self._put_question(word))
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    async def _put_question(self, word: Ask) -> None:
        if self._feed is None:
            await self._answer(word.id, {"refused": "no car is chosen"})
            return
        question = word.question
        if word.what in {"param/set", "param/save"}:
            question = {**question, "by": self._host.name[:24]}
        try:
            answer: dict[str, Any] = {"answer": await self._feed.ask(word.what, question)}
        except RefusedError as error:
            answer = {"refused": str(error)}
        await self._answer(word.id, answer)

    async def _answer(self, number: int, answer: dict[str, Any]) -> None:
        if not self._socket.closed:
            await self._socket.send_str(json.dumps({"t": "answer", "id": number, **answer}))

    async def _or_close(self, job: Coroutine[Any, Any, None]) -> None:
        """Run a helper; where it fails the socket is closed, so that the page says so and not that all is as before."""
        try:
            await job
        except ConnectionError:
            raise
        except Exception as error:  # noqa: BLE001 - logged here: the end of the session cancels this task
            log.error("a page is disconnected: %r", error)
            await self._socket.close(code=WSCloseCode.INTERNAL_ERROR, message=FAILED)

    async def _send_for_ever(self) -> None:
        while True:
            while self._urgent:
                await self._socket.send_bytes(self._urgent.pop(0))
            due_in_s = self._outbox.due_in_s(time.monotonic())
            if due_in_s <= 0:
                await self._socket.send_bytes(self._outbox.take(time.monotonic()))
                continue
            self._news.clear()
            try:
                async with asyncio.timeout(min(due_in_s, 1.0)):
                    await self._news.wait()
            except TimeoutError:
                pass

    async def _tick_for_ever(self) -> None:
        count = 0
        while True:
            await asyncio.sleep(TICK_S)
            now_s = time.monotonic()
            command = self._driver.tick(now_s)
            if command is not None:
                self._send([command])
            count += 1
            if self._shows_all and count % TICKS_PER_ALL == 0:
                self._show_all(now_s)
            if count % TICKS_PER_VIEW == 0:
                self._show_pilot(now_s)
            if count % TICKS_PER_NEWS == 0:
                self._show_monitor()

    def _show_pilot(self, now_s: float) -> None:
        self._driver.know_link(self._feed.round_trip_s if self._feed is not None else None)
        view = {**self._driver.view(now_s), "whose": self._driver.whose(self._host.drivers)}
        if self._calibrator.takes_hands:
            view |= CALIBRATING
        self.take(PILOT, topics.encode(view), now_s)
        self._show_news(CALIBRATION, self._calibrator.fields(), now_s)
        if self._feed is not None:
            lap = {"sense": self._feed.lap.words, "closed": self._feed.lap.is_closed}
            self._show_news(LAP_MAP, {**self._host.mapper.fields(self._feed.car), **lap}, now_s)

    def _show_news(self, topic: str, fields: Mapping[str, Any], now_s: float) -> None:
        """Send the state of something that seldom changes, where it has."""
        payload = topics.encode(fields)
        if payload != self._shown.get(topic):
            self._shown[topic] = payload
            self.take(topic, payload, now_s)

    def _show_all(self, now_s: float) -> None:
        overview = self._host.overview
        try:
            shown = topics.encode(overview.fields(now_s))
        except Exception as error:  # noqa: BLE001 - whatever a car publishes, the page stays, and STOP ALL with it
            self._refusals.log("all", f"the cars cannot be shown: {error!r}")
            shown = topics.encode(overview.unshown(error, now_s))
        self.take(FLEET, shown, now_s)

    def _show_monitor(self) -> None:
        self.take(MONITOR, topics.encode(self._present()), time.monotonic())

    async def _end(self, tasks: Sequence["asyncio.Task[None]"]) -> None:
        """Stop the car first if this page drove it; then clean up."""
        calibration = self._calibrator.end("The page was closed; nothing was written.")
        try:
            await self._leave(deliberate=False)
            if calibration is not None:
                await asyncio.to_thread(calibration.join)
        finally:
            self._unwatch()
            self._host.drivers.discard(self._driver)
            for error in await end(*tasks):
                if not isinstance(error, ConnectionError):
                    log.error("a visit ended badly: %r", error)
