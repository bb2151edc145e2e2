"""One viewer, from its first byte to its last, in the protocol that Foxglove, Lichtblick and PlotJuggler speak.

Text messages are JSON with the field "op"; a binary one begins with its kind, a number. What a viewer offers and
selects is its own: numbers of its channels say nothing about another viewer's.
"""

import asyncio
import json
import struct
import time
from collections import deque
from collections.abc import Callable, Coroutine, Iterable
from dataclasses import dataclass, field
from typing import Any, Final

from aiohttp import WSMsgType, web

from wallride.clients.foxglove.control import EStop, ViewedSettings
from wallride.runtime.recording.channels import STRING, schema_text, text
from wallride.runtime.ros.definitions import SCHEMA_ENCODING, TYPES
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

TEXTS: Final = (topics.STATUS, topics.DECISION)
"""Topics with JSON on zenoh; std_msgs/String here, as in a recording, so that one layout fits both."""
SCHEMAS: Final = tuple({**TYPES, **dict.fromkeys(TEXTS, STRING)}.items())
"""Topic and type by the channel's number, counted from 1."""

Take = Callable[[int, int, bytes], None]
"""Gets a channel's number, the time in ns since 1970, and the message."""
PROTOCOLS: Final = ("foxglove.sdk.v1", "foxglove.websocket.v1")
LONGEST: Final = 65536
"""Maximum length of a viewer's message in bytes; all settings at once are shorter."""
E_STOP: Final = "e_stop"
"""Topic of the e-stop: a message of any kind is a press."""
WAITING: Final = 256
"""Maximum number of messages that wait for a slow viewer; the oldest ones are lost, because newer ones replace them."""
MAX_QUESTIONS: Final = 4
MAX_NUMBERS: Final = 1024
"""Maximum number of a viewer's own channels, of its selections, and of settings that it follows."""
ERROR: Final = 2
DATA: Final = 1
_MESSAGE = struct.Struct("<BIQ")
_HEAD = struct.Struct("<BI")


class CarChannels:
    """Passes the messages of one car to every viewer. viewers: what takes them."""

    def __init__(self, bus: Bus, car: str) -> None:
        self.viewers: set[Take] = set()
        self._shown: set[int] = set()
        self._bus = bus
        self._car = car

    def show(self, number: int) -> bool:
        """Subscribe to a channel's topic on the car, once; returns whether there is such a channel."""
        if not 1 <= number <= len(SCHEMAS):
            return False
        if number not in self._shown:
            self._shown.add(number)
            topic = SCHEMAS[number - 1][0]
            wrap = text if topic in TEXTS else bytes
            self._bus.subscribe(
                topics.key(self._car, topic), lambda _k, sample, _s: self._pass_on(number, wrap(sample))
            )
        return True

    def _pass_on(self, number: int, message: bytes) -> None:
        stamp_ns = time.time_ns()
        for take in tuple(self.viewers):
            take(number, stamp_ns, message)


def offered() -> list[dict[str, object]]:
    """Return the channels as a viewer is told of them."""
    return [
        {
            "id": number, "topic": f"/{topic}", "encoding": "cdr", "schemaName": schema,
            "schemaEncoding": SCHEMA_ENCODING, "schema": schema_text(schema),
        }
        for number, (topic, schema) in enumerate(SCHEMAS, 1)
    ]  # fmt: skip


@dataclass
class Served:
    """What all viewers of a server share. viewers: those that are here."""

    car: str
    channels: CarChannels
    settings: ViewedSettings
    stop: EStop
    session: str = field(default_factory=lambda: str(time.time_ns() // 1_000_000))
    viewers: "set[Viewer]" = field(default_factory=set)


class Viewer:
    """A viewer and its WebSocket. follows: the settings whose changes it wants, all of them with "" among them."""

    def __init__(self, socket: web.WebSocketResponse, served: Served) -> None:
        self.follows: set[str] = set()
        self._socket = socket
        self._served = served
        self._selected: dict[int, int] = {}
        self._stops: set[int] = set()
        self._waiting: deque[str | bytes] = deque(maxlen=WAITING)
        self._news = asyncio.Event()
        self._asking: set[asyncio.Task[None]] = set()
        self._operations: dict[str, Callable[[dict[str, Any]], None]] = {
            "subscribe": self._select,
            "unsubscribe": self._unselect,
            "advertise": self._offer,
            "unadvertise": self._withdraw,
            "getParameters": self._get,
            "setParameters": self._set,
            "subscribeParameterUpdates": self._follow,
            "unsubscribeParameterUpdates": self._unfollow,
        }

    async def run(self) -> None:
        """Serve the viewer until it leaves, in any way."""
        self._say(
            "serverInfo", name=self._served.car, capabilities=["parameters", "parametersSubscribe", "clientPublish"],
            supportedEncodings=["json", "cdr"], metadata={}, sessionId=self._served.session,
        )  # fmt: skip
        self._say("advertise", channels=offered())
        self._served.viewers.add(self)
        self._served.channels.viewers.add(self._take)
        sender = asyncio.create_task(self._send_for_ever())
        try:
            async for message in self._socket:
                self._receive(message.type, message.data)
        finally:
            self._served.viewers.discard(self)
            self._served.channels.viewers.discard(self._take)
            helpers = [sender, *self._asking]
            for helper in helpers:
                helper.cancel()
            await asyncio.gather(*helpers, return_exceptions=True)

    def tell(self, parameters: list[dict[str, object]]) -> None:
        """Pass on changed settings, those that this viewer follows."""
        wanted = [one for one in parameters if "" in self.follows or one["name"] in self.follows]
        if wanted:
            self._say("parameterValues", parameters=wanted)

    async def _send_for_ever(self) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            while self._waiting:
                message = self._waiting.popleft()
                await (self._socket.send_str(message) if isinstance(message, str) else self._socket.send_bytes(message))

    def _put(self, message: str | bytes) -> None:
        self._waiting.append(message)
        self._news.set()

    def _say(self, operation: str, **fields: object) -> None:
        self._put(json.dumps({"op": operation, **fields}))

    def _warn(self, words: str) -> None:
        self._say("status", level=ERROR, message=words)

    def _take(self, number: int, stamp_ns: int, message: bytes) -> None:
        for selection, channel in self._selected.items():
            if channel == number:
                self._put(_MESSAGE.pack(DATA, selection, stamp_ns) + message)

    def _receive(self, kind: WSMsgType, data: Any) -> None:  # noqa: ANN401 - text or bytes, as aiohttp has it
        try:
            if kind is WSMsgType.TEXT:
                message = topics.decode(data)
                self._operations[message["op"]](message)
            elif len(data) >= _HEAD.size and _HEAD.unpack_from(data)[1] in self._stops:
                self._served.stop.press(self._warn)
        except (KeyError, TypeError, ValueError, struct.error) as error:
            self._warn(f"not understood: {type(error).__name__}")

    def _select(self, message: dict[str, Any]) -> None:
        for one in message["subscriptions"]:
            selection, number = _number(one["id"]), _number(one["channelId"])
            if not self._served.channels.show(number):
                self._warn(f"there is no channel {number}")
            elif len(self._selected) < MAX_NUMBERS:
                self._selected[selection] = number

    def _unselect(self, message: dict[str, Any]) -> None:
        for selection in message["subscriptionIds"]:
            self._selected.pop(selection, None)

    def _offer(self, message: dict[str, Any]) -> None:
        for one in message["channels"]:
            number = _number(one["id"])
            if str(one["topic"]).strip("/") == E_STOP and len(self._stops) < MAX_NUMBERS:
                self._stops.add(number)

    def _withdraw(self, message: dict[str, Any]) -> None:
        self._stops.difference_update(message["channelIds"])

    def _follow(self, message: dict[str, Any]) -> None:
        names = _names(message) or {""}
        if len(self.follows | names) <= MAX_NUMBERS:
            self.follows |= names

    def _unfollow(self, message: dict[str, Any]) -> None:
        self.follows -= _names(message) or set(self.follows)

    def _get(self, message: dict[str, Any]) -> None:
        self._ask(self._answer(message.get("id"), self._served.settings.get(_names(message))))

    def _set(self, message: dict[str, Any]) -> None:
        values = {str(one["name"]): one.get("value") for one in message["parameters"]}
        self._ask(self._answer(message.get("id"), self._served.settings.set(values), changed=True))

    def _ask(self, question: Coroutine[Any, Any, None]) -> None:
        if len(self._asking) >= MAX_QUESTIONS:
            question.close()
            self._warn("too many questions at once")
            return
        task = asyncio.create_task(question)
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    async def _answer(
        self, number: object, question: Coroutine[Any, Any, list[dict[str, object]]], *, changed: bool = False
    ) -> None:
        found = await question
        if number is not None or not changed:
            self._say("parameterValues", parameters=found, **({"id": number} if number is not None else {}))
        if changed:
            for other in tuple(self._served.viewers - {self}):
                other.tell(found)


def _names(message: dict[str, Any]) -> set[str]:
    names: Iterable[object] = message["parameterNames"]
    return set(map(str, names))


def _number(value: object) -> int:
    if not isinstance(value, int) or not 0 <= value < 1 << 32:
        raise ValueError("not a number of a channel")
    return value
