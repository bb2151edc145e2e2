"""One zenoh session, for the car and for clients alike: publishes without waiting, delivers through the event loop.

The only module that imports zenoh, and it does so late, because a car must be able to stop before it can communicate.
zenoh calls back in threads of its own; everything it brings crosses into the loop here, in order, with the time at
which it arrived, one wake-up per burst.
"""

import asyncio
import contextlib
import copy
import errno
import functools
import json
import logging
import re
import socket
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from runtime.wire.endpoints import split_endpoint
from runtime.wire.ingress import MAX_QUESTION_BYTES

if TYPE_CHECKING:
    import zenoh

log = logging.getLogger("wallride.bus")

JSON = "application/json"
CDR = "application/cdr"
BYTES = "application/octet-stream"

Receive = Callable[[str, bytes, float], None]
"""key, payload, arrival_s on the monotonic clock."""
ReceiveAttached = Callable[[bytes, bytes | None, float], None]
"""payload, attachment, arrival_s on the monotonic clock."""
Reply = Callable[[bytes], bytes | Awaitable[bytes]]
Changed = Callable[[str, bool], None]

SOURCE_PLACE = re.compile(r" at /?[\w./@-]*\.rs:\d+\.?")
SINGLE = re.compile(r"\[Single\(([^)]*)\)\]")
BACKLOG = 256
"""Maximum number of samples of one burst per subscription; the oldest beyond it are dropped, because newer messages
replace older ones."""
MAX_DELIVERIES = 16
"""Maximum deliveries per subscription and turn of the loop. zenoh refills a mailbox as fast as it is emptied: without a
limit a flood of 35,000 commands/s kept the loop from the motor for up to 4 s."""
MAX_SAMPLE_BYTES = 65536
"""Maximum size of an accepted sample; telemetry's largest, a scan of 4321 beams, has 17 kB."""
ASK_AGAIN_AFTER_S = 0.12
ASK_AGAIN_FOR_S = 0.6
"""A car that holds back a question, because another one came a moment ago, answers at once with nothing."""


IN_USE = "Address already in use"
"""Text of zenoh's error for a taken port."""
OPEN_ATTEMPTS = 5
"""Number of attempts to open: a port that was free a moment ago may be taken when it is opened."""


class RefusedError(Exception):
    """Refusal by the other side; the text is its reason."""


class PortTakenError(OSError):
    """Another program listens on one of the session's addresses. endpoint: that address."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(f"{endpoint} is taken by another program")
        self.endpoint = endpoint


class Network(Protocol):
    """The car's interface to a bus; in whole-car tests an implementation in memory."""

    @property
    def endpoint(self) -> str:
        """Endpoint at which the car can be reached."""
        ...

    @property
    def is_open(self) -> bool:
        """Whether the session is open, so that `put` sends."""
        ...

    @property
    def dropped(self) -> int:
        """Number of samples put while it was closed."""
        ...

    @property
    def session_id(self) -> str:
        """Return zenoh's id of the open session."""
        ...

    def put(self, key: str, payload: bytes, *, encoding: str = JSON, urgent: bool = False) -> None:
        """Publish without waiting."""
        ...

    def put_attached(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Publish with an attachment, without waiting."""
        ...

    def put_latched(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Publish, and keep the message for late subscribers."""
        ...

    def wanted(self, key: str, *, encoding: str = JSON, urgent: bool = False) -> bool:
        """Tell whether the key has a subscriber."""
        ...

    def subscribe(self, key: str, receive: Receive, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Subscribe to a key."""
        ...

    def subscribe_attached(self, key: str, receive: ReceiveAttached, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Subscribe to a key whose samples carry attachments."""
        ...

    def answer(self, key: str, reply: Reply) -> None:
        """Answer queries on a key."""
        ...

    def announce(self, key: str) -> None:
        """Hold a liveliness token."""
        ...

    def when_open(self, declare: Callable[[], None]) -> None:
        """Call once the session is open."""
        ...

    def poll(self) -> None:
        """Deliver what has come in."""
        ...


class Bus:
    """Publishes, subscribes, queries and answers. What is declared before `open` takes effect when it opens.

    any_port: take a free port in place of a taken one on loopback; otherwise a taken port is a PortTakenError.
    endpoint: where it listens or connects; known for certain once it is open.
    dropped: samples put while closed; strays: samples that came for another key than the one subscribed to; oversized:
        samples that were too large.
    """

    def __init__(self, config: Mapping[str, Any], *, any_port: bool = False) -> None:
        self._config = copy.deepcopy(dict(config))
        self._any_port = any_port
        self._session: zenoh.Session | None = None
        self._declare: list[Callable[[], object]] = []
        self._held: list[object] = []  # publishers and tokens end with their Python object
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._answering: set[asyncio.Future[None]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._troubles: tuple[type[Exception], ...] = (ConnectionError,)
        self.dropped = 0
        self.strays = 0
        self.oversized = 0

    @property
    def endpoint(self) -> str:
        """The first endpoint."""
        return str((self._endpoints("listen") or self._endpoints("connect") or ["nowhere"])[0])

    @property
    def is_open(self) -> bool:
        """Whether the session is open, so that `put` sends."""
        return self._session is not None

    async def open(self) -> None:
        """Open the session in a thread; OSError with a plain reason on failure, PortTakenError for a taken port."""
        self._loop = asyncio.get_running_loop()
        self._session = await asyncio.to_thread(self._opened)
        import zenoh

        self._troubles = (ConnectionError, zenoh.ZError)
        for declare in tuple(self._declare):  # what one of them declares takes effect at once, and not twice
            declare()

    async def close(self) -> None:
        """Close the session; harmless when it never opened."""
        session, self._session = self._session, None
        self._publishers.clear()
        self._held.clear()
        if session is not None:
            await asyncio.to_thread(session.close)

    @property
    def session_id(self) -> str:
        """Return zenoh's id of the open session; ConnectionError while it is closed."""
        return str(self._open_session.info.zid())

    def put(self, key: str, payload: bytes, *, encoding: str = JSON, urgent: bool = False) -> None:
        """Publish without waiting: a slow or vanished reader loses samples, the car loses nothing.

        encoding and urgent belong to the key: the first call decides.
        """
        try:
            publisher = self._publishers.get(key) or self._publisher(key, encoding, urgent=urgent)
            publisher.put(payload)
        except self._troubles:
            self.dropped += 1

    def put_attached(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Publish with an attachment, as `put` does."""
        try:
            publisher = self._publishers.get(key) or self._publisher(key, encoding, urgent=False)
            publisher.put(payload, attachment=attachment)
        except self._troubles:
            self.dropped += 1

    def wanted(self, key: str, *, encoding: str = JSON, urgent: bool = False) -> bool:
        """Tell whether a key has a subscriber at this moment."""
        try:
            publisher = self._publishers.get(key) or self._publisher(key, encoding, urgent=urgent)
        except ConnectionError:
            return False
        status: Any = publisher.matching_status  # an object with `matching`; the package's stubs say bool
        return bool(status.matching)

    def subscribe(self, key: str, receive: Receive, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Call `receive` in the loop for every sample; with a key free of wildcards, for exactly that key only.

        A put may carry a wildcard ("car/*/teleop") and still reach an exact subscription; such a stray is counted, and
        so is a sample larger than max_bytes, which is dropped before its bytes are copied.
        """
        self._whenever_open(lambda: self._subscribe(key, receive, max_bytes))

    def answer(self, key: str, reply: Reply) -> None:
        """Answer queries on exactly this key in the loop; RefusedError becomes an error reply with its text."""
        self._whenever_open(lambda: self._answer(key, reply))

    def announce(self, key: str) -> None:
        """Hold a liveliness token until close."""
        self._whenever_open(lambda: self._held.append(self._open_session.liveliness().declare_token(key)))

    def when_open(self, declare: Callable[[], None]) -> None:
        """Call once the session is open; at once if it is."""
        self._whenever_open(declare)

    def watch(self, key: str, changed: Changed) -> None:
        """Call `changed(key, alive)` in the loop for every liveliness token, including those already present."""
        self._whenever_open(lambda: self._watch(key, changed))

    async def ask(self, key: str, payload: bytes = b"", *, timeout_s: float = 1.0) -> list[bytes]:
        """Return all answers; [] when no answer comes in time. RefusedError when the answer is an error."""
        if len(payload) > MAX_QUESTION_BYTES:  # the car would not even hear it
            raise RefusedError(f"the question is longer than {MAX_QUESTION_BYTES} bytes")
        until_s = time.monotonic() + min(timeout_s, ASK_AGAIN_FOR_S)
        while not (answers := await self._ask_once(key, payload, timeout_s)):
            if time.monotonic() + ASK_AGAIN_AFTER_S > until_s:
                break
            await asyncio.sleep(ASK_AGAIN_AFTER_S)
        return answers

    async def _ask_once(self, key: str, payload: bytes, timeout_s: float) -> list[bytes]:
        import zenoh

        loop = asyncio.get_running_loop()
        replies: list[zenoh.Reply] = []
        done = asyncio.Event()
        collect: zenoh.handlers.Callback[zenoh.Reply] = zenoh.handlers.Callback(
            lambda reply: _into(loop, functools.partial(replies.append, reply)), lambda: _into(loop, done.set)
        )
        drop = zenoh.CongestionControl.DROP  # zenoh's default would hold up the loop while a link is full
        self._open_session.get(key, collect, payload=payload, timeout=timeout_s, congestion_control=drop)
        await asyncio.wait_for(done.wait(), timeout_s + 1)
        answers = []
        for reply in replies:
            if reply.ok is not None:
                answers.append(reply.ok.payload.to_bytes())
            elif (
                reply.err is not None and (reason := reply.err.payload.to_bytes().decode(errors="replace")) != "Timeout"
            ):
                raise RefusedError(reason)
        return answers

    def _publisher(self, key: str, encoding: str, *, urgent: bool) -> "zenoh.Publisher":
        import zenoh

        # Not zenoh's default DATA: its answers to questions that it refuses by itself have that, and block.
        publisher = self._open_session.declare_publisher(
            key,
            encoding=zenoh.Encoding(encoding),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.DATA_HIGH,
            express=urgent,
        )
        self._publishers[key] = publisher
        return publisher

    def _subscribe(self, key: str, receive: Receive, max_bytes: int) -> None:
        exact = "*" not in key
        mailbox = Mailbox(self._running_loop, receive)

        def on_sample(sample: "zenoh.Sample") -> None:  # zenoh's thread
            name = str(sample.key_expr)
            if exact and name != key:
                self.strays += 1
            elif len(sample.payload) > max_bytes:
                self.oversized += 1
            else:
                mailbox.post((name, sample.payload.to_bytes(), time.monotonic()))

        self._held.append(self._open_session.declare_subscriber(key, on_sample))

    def _watch(self, key: str, changed: Changed) -> None:
        import zenoh

        mailbox = Mailbox(self._running_loop, changed)

        def on_token(sample: "zenoh.Sample") -> None:  # zenoh's thread
            mailbox.post((str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))

        self._held.append(self._open_session.liveliness().declare_subscriber(key, on_token, history=True))

    def _answer(self, key: str, reply: Reply) -> None:
        mailbox = Mailbox(self._running_loop, functools.partial(self._reply_to, key, reply))

        def on_query(query: "zenoh.Query") -> None:  # zenoh's thread
            mailbox.post((query,))

        self._held.append(self._open_session.declare_queryable(key, on_query))

    def _reply_to(self, key: str, reply: Reply, query: "zenoh.Query") -> None:
        answering = asyncio.ensure_future(_reply(key, reply, query))
        self._answering.add(answering)
        answering.add_done_callback(self._answering.discard)

    def _whenever_open(self, declare: Callable[[], object]) -> None:
        self._declare.append(declare)
        if self._session is not None:
            declare()

    @property
    def _open_session(self) -> "zenoh.Session":
        if self._session is None:
            raise ConnectionError("the session is not open")
        return self._session

    @property
    def _running_loop(self) -> asyncio.AbstractEventLoop:
        if self._loop is None:
            raise ConnectionError("the session is not open")
        return self._loop

    def _endpoints(self, side: str) -> list[Any]:
        return list(self._config.get(side, {}).get("endpoints", []))

    def _opened(self) -> "zenoh.Session":
        """Return an open session; opening it is the only test of a free port."""
        for _ in range(OPEN_ATTEMPTS - 1):
            try:
                return _open_session(self._config)
            except OSError as error:
                self._consider_ports(error)
        return _open_session(self._config)

    def _consider_ports(self, error: OSError) -> None:
        """Replace taken ports where that is allowed; raise when the next attempt would fail for the same reason."""
        endpoints = self._endpoints("listen")
        taken = [i for i, endpoint in enumerate(endpoints) if is_taken(endpoint)]
        for i in taken:
            if not self._any_port or not endpoints[i].startswith("tcp/"):
                raise PortTakenError(endpoints[i]) from error
            free = free_endpoint()
            log.info("%s is taken; listening on %s instead", endpoints[i], free)
            endpoints[i] = free
        if not taken and IN_USE not in str(error):  # neither now nor a moment ago: another problem
            raise error
        self._config["listen"] = {**self._config.get("listen", {}), "endpoints": endpoints}


class Mailbox:
    """Carries calls from zenoh's threads into the loop, in order, with one wake-up per burst.

    A burst is delivered over as many turns of the loop as it needs, so that devices and timers have their turns.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, deliver: Callable[..., None]) -> None:
        self._loop = loop
        self._deliver = deliver
        self._waiting: deque[tuple[Any, ...]] = deque(maxlen=BACKLOG)
        self._woken = False

    def post(self, arguments: tuple[Any, ...]) -> None:
        """Hand over; called in a foreign thread."""
        self._waiting.append(arguments)
        if not self._woken:
            self._woken = True
            _into(self._loop, self._drain)

    def _drain(self) -> None:
        for _ in range(min(MAX_DELIVERIES, len(self._waiting))):
            self._deliver(*self._waiting.popleft())
        self._woken = False  # before the check: whatever is posted from here on wakes the loop again
        if self._waiting:
            self._woken = True
            self._loop.call_soon(self._drain)


def _into(loop: asyncio.AbstractEventLoop, call: Callable[[], object]) -> None:
    with contextlib.suppress(RuntimeError):  # the loop has closed: there is no listener left
        loop.call_soon_threadsafe(call)


async def _reply(key: str, reply: Reply, query: "zenoh.Query") -> None:
    with query:  # leaving it ends the query; otherwise the client would wait for its timeout
        if str(query.key_expr) != key:
            query.reply_err(f"ask {key} itself, not {query.key_expr}".encode())
            return
        try:
            answer = reply(query.payload.to_bytes() if query.payload is not None else b"")
            query.reply(key, answer if isinstance(answer, bytes) else await answer, encoding=JSON)
        except RefusedError as error:
            query.reply_err(str(error).encode())


def free_endpoint() -> str:
    """Return a loopback endpoint whose port is free at this moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def is_taken(endpoint: str) -> bool:
    """Tell whether another program listens on an endpoint's port."""
    _, host, port = split_endpoint(endpoint)
    try:
        places = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_STREAM)
    except OSError:
        return False
    return any(_is_bound(family, place) for family, _, _, _, place in places)


def _is_bound(family: int, place: Any) -> bool:  # noqa: ANN401 - the socket module's own form of an address
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(place)
        except OSError as error:
            return error.errno == errno.EADDRINUSE
    return False


def _open_session(config: Mapping[str, Any]) -> "zenoh.Session":
    import zenoh

    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    except zenoh.ZError as error:
        raise OSError(_plain(str(error))) from error


def _plain(words: str) -> str:
    """Return zenoh's reason without its source locations."""
    reason = SOURCE_PLACE.sub("", words.splitlines()[0] if words else "no reason given")
    return SINGLE.sub(r"\1", reason).rstrip(" .")
