"""Subscriptions of one car, for all pages that watch it: one each, however many pages there are."""

import asyncio
import json
import math
import time
from collections.abc import Mapping
from typing import Any, Protocol

from wallride.clients.answers import why_unanswered
from wallride.clients.connection import another_car
from wallride.clients.monitor.history import PlotHistory
from wallride.clients.monitor.lap_watch import LapWatch
from wallride.clients.monitor.outbox import FROM_CAR
from wallride.clients.parameters import SAVED_WITHIN_S
from wallride.clients.played import PlayedNames
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES, RefusedError
from wallride.runtime.wire.teleop import Beat, Command, Malformed, read_beat

RETRY_S = 0.5
ASK_EVERY_S = 1.0
ANSWER_WITHIN_S = 2.0
KNOWN_FOR_S = 0.5
"""Validity of an identity, 25 heartbeats; a program's end and another's start on its port take longer."""
STANDS_MPS = 0.05
STATUS_WITHIN_S = 2.0
"""Maximum age of a status that tells whether the car stands; it is sent several times a second."""
SMALL_QUESTION = json.dumps({"names": ["car.name"]}).encode()


class Watcher(Protocol):
    """Listener to one car. Neither call may wait."""

    def take(self, topic: str, payload: bytes, arrival_s: float) -> None:
        """Take a sample."""

    def hear(self, beat: Beat, payload: bytes, arrival_s: float) -> None:
        """Take a heartbeat."""


class PageFeed:
    """One session with one car, open while a page watches.

    session: of the selected process of the car, None for the first to answer; messages of another one are not passed
    on, and it is sent nothing.
    round_trip_s: of a small query to the car, None when it does not answer. problem: why there is no session.
    malformed: beats that could not be read. history: what pages plot, also from before the feed.
    lap: whether the lap that is driven has met its beginning.
    """

    def __init__(
        self, car: str, config: Mapping[str, Any], session: int | None = None, history: PlotHistory | None = None
    ) -> None:
        self.car = car
        self.round_trip_s: float | None = None
        self.problem = "connecting"
        self.malformed = 0
        self._session = session
        self._known_s = -math.inf
        self.watchers: set[Watcher] = set()
        self.history = history or PlotHistory()
        self._bus = Bus(config)
        self._played = PlayedNames(self._bus, car)
        self._topics = {topics.key(car, topic): topic for topic in FROM_CAR}
        self._status = b"", -math.inf
        self.lap = LapWatch()
        for key in self._topics:
            self._bus.subscribe(key, self._on_sample)

    @property
    def is_by_keys(self) -> bool:
        """Whether certificates say who may do what."""
        return self._bus.is_by_keys

    @property
    def is_recording(self) -> bool:
        """Whether what has the car's name is a recording that is played."""
        return self.car in self._played

    def why_not_standing(self, now_s: float) -> str:
        """Return why the car is not known to stand, "" when it is."""
        payload, arrival_s = self._status
        if now_s - arrival_s > STATUS_WITHIN_S:
            return f"{self.car} is not heard: wait until the page shows it"
        try:
            speed_mps = topics.decode(payload).get("speed_mps")
        except (ValueError, TypeError):
            return f"the status of {self.car} cannot be read: is another version on it?"
        drives = isinstance(speed_mps, int | float) and not abs(speed_mps) <= STANDS_MPS
        return f"{self.car} drives: stop it first" if drives else ""

    async def run(self) -> None:
        """Connect, connect again, measure the round trip; until cancelled."""
        try:
            while True:
                connected = self._bus.is_open or await self._connect()
                if connected:
                    await self._measure()
                await asyncio.sleep(ASK_EVERY_S if connected else RETRY_S)
        finally:
            await self._bus.close()

    def send(self, command: Command) -> None:
        """Send a command at once; a failed one is dropped, and the car stops by itself."""
        if not self._is_meant():
            return
        self._bus.put(topics.key(self.car, topics.COMMAND), command.pack(), encoding=BYTES, urgent=True)

    async def ask(self, what: str, question: Mapping[str, Any]) -> dict[str, Any]:
        """Send a query to the car; RefusedError with its reason, or ours when the car does not answer."""
        if not self._is_meant():
            raise RefusedError(self.problem or f"{self.car} is not heard")
        timeout_s = SAVED_WITHIN_S if what in {"param/save", "param/restart"} else ANSWER_WITHIN_S
        try:
            answers = await self._bus.ask(
                topics.key(self.car, what), json.dumps(question).encode() if question else b"", timeout_s=timeout_s
            )
        except (ConnectionError, TimeoutError):
            answers = []
        if not answers:
            raise RefusedError(f"{self.car} does not answer: {why_unanswered(by_keys=self.is_by_keys)}")
        try:
            return topics.decode(answers[0])
        except (ValueError, TypeError):
            raise RefusedError(f"{self.car} answered something that cannot be read") from None

    async def _connect(self) -> bool:
        try:
            await self._bus.open()
        except OSError as error:
            self.problem = str(error)
            return False
        self.problem = ""
        return True

    async def _measure(self) -> None:
        before_s = time.monotonic()
        try:
            answered = await self._bus.ask(topics.key(self.car, f"{topics.PARAM}/get"), SMALL_QUESTION, timeout_s=1.0)
        except RefusedError:
            answered = [b""]  # an error is an answer too
        except (ConnectionError, TimeoutError):
            answered = []
        self.round_trip_s = time.monotonic() - before_s if answered else None
        self.history.take_round_trip(self.round_trip_s, time.monotonic())

    def _on_sample(self, key: str, payload: bytes, arrival_s: float) -> None:
        topic = self._topics[key]
        if topic != topics.BEAT:
            if not self._is_meant():
                return
            self.history.take(topic, payload, arrival_s)
            self.lap.take(topic, payload)
            if topic == topics.STATUS:
                self._status = payload, arrival_s
            for watcher in self.watchers:
                watcher.take(topic, payload, arrival_s)
            return
        try:
            beat = read_beat(payload)
        except Malformed:
            self.malformed += 1
            return
        if self._session not in {None, beat.car_session}:
            self._known_s = -math.inf
            self.problem = another_car(self.car, self._bus.endpoint, self._session or 0, beat.car_session)
            return
        self._known_s, self.problem = arrival_s, ""
        for watcher in self.watchers:
            watcher.hear(beat, payload, arrival_s)

    def _is_meant(self) -> bool:
        """Return whether the answering car is the selected one, by a heartbeat of just now."""
        return self._session is None or time.monotonic() - self._known_s < KNOWN_FOR_S
