"""A car over the network, for scripts: `with wallride.connect("car1") as car: ...`."""

import argparse
import json
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Self

from wallride.clients import CONNECT_VARIABLE, DEFAULT_CONNECT
from wallride.clients.answers import asked
from wallride.clients.connection import ConnectionProblemError, check_session, find_car, open_bus, with_one_endpoint
from wallride.clients.parameters import MAX_NAME_LENGTH, ask
from wallride.clients.played import NOTHING_DRIVES
from wallride.clients.remote.driver import RemoteDriver, checked_hand
from wallride.clients.remote.loop_thread import CLOSED, LoopThread
from wallride.clients.remote.planner import RemotePlanner
from wallride.clients.remote.stream import Stream
from wallride.clients.remote.values import value_of
from wallride.clients.topics import KINDS
from wallride.runtime.host.ownership import user_name
from wallride.runtime.recording import requests
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus

Ask = Callable[..., Mapping[str, Any]]
BUFFER: Final = 1000
SILENT_S: Final = 5.0
SELDOM_S: Final = 15.0
"""Longest silence of topics that change once a drive, and come every 5 s."""


class RemoteParameters:
    """Settings by their dotted names; a change takes effect at once, or is refused whole (RefusedError).

    ask: sends one question to the car's parameter server.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask
        self._by = user_name("")[:MAX_NAME_LENGTH]

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - a number, text, flag or list
        return self._ask("get", names=[name])["values"][name]

    def __setitem__(self, name: str, value: object) -> None:
        self.update({name: value})

    def __iter__(self) -> Iterator[str]:
        return iter(self.describe())

    def update(self, values: Mapping[str, object]) -> None:
        """Change several settings, all or none."""
        self._ask("set", values=dict(values), by=self._by)

    def describe(self, under: str = "") -> dict[str, Mapping[str, Any]]:
        """Return value, default, range, unit and sentence of each setting whose name begins so."""
        return {entry["name"]: entry for entry in self._ask("list", under=under)["parameters"]}

    def save(self) -> None:
        """Write the changes to the car's settings file."""
        self._ask("save", by=self._by)


class RemoteCar:
    """One car. Close it, or use it in a `with` or `async with` block.

    Reading changes what the car does: it writes a topic from its first reader here until `close`. Rates are those of
    `telemetry.rates_hz`.

    name: of the car. parameters: its settings. options: those of a client's command. operator: name that the car shows
    while this one drives; by default the user's.
    """

    def __init__(self, options: argparse.Namespace, operator: str | None = None) -> None:
        self._options = options
        self._operator = operator or f"{user_name('script')}@{socket.gethostname().split('.')[0]}"
        self._thread = LoopThread()
        self._streams: dict[str, list[Stream[Any]]] = {}
        self._is_played = False
        self._lock = threading.Lock()
        try:
            self._bus, self.name = self._thread.call(self._connected())
        except BaseException:
            self._thread.close()
            raise
        self.parameters = RemoteParameters(self._ask)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all iterations, questions, blocks and the connection, of any thread; harmless when it is closed.

        A `drive` or `plan` block that is open ends as after a lost operator: the car stops.
        """
        self._thread.close()
        with self._lock:
            streams = [stream for streams in self._streams.values() for stream in streams]
        for stream in streams:
            stream.close()

    def topic(self, name: str, *, newest: bool = False, timeout_s: float | None = None) -> Stream[Any]:
        """Return an iterator over the values of a topic, for `for` and `async for`.

        newest: skip what came while the last value was worked on, as a controller wants it; else up to BUFFER values
        wait. timeout_s: maximum wait for a value, then a ConnectionProblemError; by default 5 s, 15 s for what comes
        seldom.
        """
        return self._stream((name,), lambda raw: value_of(*raw), newest=newest, timeout_s=timeout_s)

    def topics(self, *names: str, timeout_s: float | None = None) -> Stream[tuple[str, Any]]:
        """Return an iterator over topic and value of several topics, in the order of their arrival."""
        return self._stream(names, lambda raw: (raw[0], value_of(*raw)), newest=False, timeout_s=timeout_s)

    def latest(self, name: str, *, timeout_s: float | None = None) -> Any:  # noqa: ANN401 - a value of the topic
        """Return the next value of a topic."""
        stream = self.topic(name, newest=True, timeout_s=timeout_s)
        try:
            return next(stream)
        except StopIteration:  # would end the caller's own loop without a word
            raise ConnectionProblemError(CLOSED) from None
        finally:
            self._forget(stream)

    def drive(self, *, max_speed_mps: float = 1.5, max_steering_rad: float = 0.34) -> RemoteDriver:
        """Return a `with` block in which this script drives, under the rules for operators; needs the role operator."""
        hand = checked_hand(max_speed_mps, max_steering_rad)
        return RemoteDriver(self._thread, self._open, self.name, self._operator, hand)

    def plan(self, name: str, *, max_speed_mps: float = 3.0, max_steering_rad: float = 0.4) -> RemotePlanner:
        """Return a `with` block in which this script plans in the follower's place (docs/planners.md).

        name: one of the car's `planners.names`; over tls that of your certificate, whose role is planner.
        """
        hand = checked_hand(max_speed_mps, max_steering_rad)
        return RemotePlanner(self._thread, self._open, self.name, name, hand)

    @contextmanager
    def record(self) -> Iterator[Mapping[str, Any]]:
        """Record on the car within a `with` block, whose value is the recorder's state; needs the role admin.

        After the block what held before holds again: `recording.start`, or an earlier request. ConnectionProblemError
        when the car does not answer, RefusedError when its recording is turned off.
        """
        before = self._record()["requested"]
        try:
            yield self._record(on=True)
        finally:
            self._record(by_itself=True) if before is None else self._record(on=before)

    def _record(self, **wish: bool) -> Mapping[str, Any]:
        question = json.dumps(wish).encode()
        with self._answered():
            answer = self._thread.call(asked(self._bus, self.name, requests.RECORD, question))
        return topics.decode(answer)

    def _ask(self, what: str, **question: Any) -> Mapping[str, Any]:  # noqa: ANN401 - as JSON
        with self._answered():
            return self._thread.call(ask(self._bus, self.name, what, **question))

    @contextmanager
    def _answered(self) -> Iterator[None]:
        """Say of a question without an answer where it is a recording that was asked."""
        try:
            yield
        except ConnectionProblemError:
            if self._is_played:
                raise ConnectionProblemError(f"{self.name}: {NOTHING_DRIVES}; it answers no questions") from None
            raise

    def _stream(self, names: tuple[str, ...], read: Any, *, newest: bool, timeout_s: float | None) -> Stream[Any]:  # noqa: ANN401
        for name in names:
            if name not in KINDS:
                raise ConnectionProblemError(f"{name} is not a topic; there are {', '.join(KINDS)}")
        if not names:
            raise ConnectionProblemError(f"name at least one topic; there are {', '.join(KINDS)}")
        self._thread.check_open()
        if timeout_s is None:
            timeout_s = SELDOM_S if topics.LASTING.issuperset(names) else SILENT_S
        silent = (
            f"{self.name} says nothing on {', '.join(names)} for {timeout_s} s: the car or the link is gone"
            " (`wallride status`), or what it comes from is silent"
        )
        stream: Stream[Any] = Stream(read, buffer=1 if newest else BUFFER, timeout_s=timeout_s, silent=silent)
        for name in names:
            with self._lock:
                first = name not in self._streams
                self._streams.setdefault(name, []).append(stream)
            if first:
                self._thread.call(self._subscribe(name))
        return stream

    async def _subscribe(self, name: str) -> None:
        streams = self._streams[name]
        self._bus.subscribe(
            topics.key(self.name, name), lambda _key, payload, _s: self._pass_on(name, streams, payload)
        )

    def _pass_on(self, name: str, streams: list[Stream[Any]], payload: bytes) -> None:
        raw = name, payload, time.time()
        with self._lock:
            for stream in streams:
                stream.put(raw)

    def _forget(self, stream: Stream[Any]) -> None:
        with self._lock:
            for streams in self._streams.values():
                streams[:] = [one for one in streams if one is not stream]

    async def _connected(self) -> tuple[Bus, str]:
        options = self._options = await with_one_endpoint(self._options)
        bus = await self._open()
        try:
            name = await find_car(bus, options.car)
            bus.watch(topics.key(name, topics.PLAYED), self._on_played)
            if options.session is not None:
                await check_session(bus, name, options.session)
        except BaseException:
            await bus.close()
            raise
        return bus, name

    def _on_played(self, _key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        self._is_played = alive

    async def _open(self) -> Bus:
        return self._thread.look_after(await open_bus(self._options))


def connect(
    car: str | None = None, *, at: str | None = None, keys: Path | str | None = None, session: int | None = None,
    name: str | None = None,
) -> RemoteCar:  # fmt: skip
    """Connect to a car, within 4 s; ConnectionProblemError with the remedy when it cannot be reached.

    car: its name; None for the only one there. at: its address, such as tls/car1.local:7448, or several with commas,
    which are searched for it, 4 s longer; by default $WALLRIDE_CONNECT, else this computer. keys: folder of your keys,
    for tls. session: of this very start of the car. name: shown by the car while you drive.
    """
    options = argparse.Namespace(
        car=car, connect=at or os.environ.get(CONNECT_VARIABLE) or DEFAULT_CONNECT,
        keys=Path(keys) if keys is not None else None, session=session, connect_option="at=",
    )  # fmt: skip
    if not isinstance(options.connect, str) or not isinstance(car, str | None):
        example = f'connect("car1", at="{DEFAULT_CONNECT}")'
        raise ConnectionProblemError(f"car={car!r}, at={at!r}: both are text, e.g. {example}")
    return RemoteCar(options, name)
