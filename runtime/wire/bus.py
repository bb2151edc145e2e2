"""One zenoh session, for the car and for clients alike: publishes without waiting, delivers through the event loop.

The only module that imports zenoh, and it does so late, because a car must be able to stop before it can communicate.
zenoh calls back in threads of its own; everything it brings crosses into the loop here, in order, with the time at
which it arrived, one wake-up per burst.
"""

import asyncio
import copy
import functools
import json
import logging
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from wallride.runtime.wire import topics
from wallride.runtime.wire.ingress import MAX_QUESTION_BYTES
from wallride.runtime.wire.mailbox import Mailbox, call_in_loop
from wallride.runtime.wire.network import JSON, MAX_SAMPLE_BYTES, Changed, PortTakenError, Receive, RefusedError, Reply
from wallride.runtime.wire.ports import free_endpoint, is_taken

if TYPE_CHECKING:
    import zenoh

log = logging.getLogger("wallride.bus")

SOURCE_PLACE = re.compile(r" at /?[\w./@-]*\.rs:\d+\.?")
SINGLE = re.compile(r"\[Single\(([^)]*)\)\]")
ASK_AGAIN_AFTER_S = 0.12
ASK_AGAIN_FOR_S = 0.6
MAX_ANSWERS = 16
"""A car that holds back a question, because another one came a moment ago, answers at once with nothing."""


CLOSES_WITHIN_S = 1.0
CALLER = "pyo3-closure"
"""Part of the name of a thread in which zenoh calls a function of Python."""
LAST_S = 2**32
"""Time since 1970 at which zenoh's time stamps end."""
IN_USE = "Address already in use"
"""Text of zenoh's error for a taken port."""
OPEN_ATTEMPTS = 5
"""Number of attempts to open: a port that was free a moment ago may be taken when it is opened."""


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
        self._callers: list[threading.Thread] = []
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._answering: set[asyncio.Future[None]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._troubles: tuple[type[Exception], ...] = (ConnectionError,)
        self.dropped = 0
        self.strays = 0
        self.oversized = 0

    @property
    def endpoint(self) -> str:
        """The first endpoint; "" for a session that neither listens nor connects."""
        return str((self._endpoints("listen") or self._endpoints("connect") or [""])[0])

    @property
    def is_by_keys(self) -> bool:
        """Whether certificates say who may do what."""
        return self.endpoint.startswith("tls/")

    @property
    def is_open(self) -> bool:
        """Whether the session is open, so that `put` sends."""
        return self._session is not None

    async def open(self) -> None:
        """Open the session in a thread; OSError with a plain reason on failure, PortTakenError for a taken port."""
        if time.time() >= LAST_S:  # else it panics: an error in its threads, and one that ends a program, here
            raise OSError("the computer's clock is after 2106, where zenoh ends: set it (timedatectl) and start again")
        self._loop = asyncio.get_running_loop()
        self._session = await asyncio.to_thread(self._opened)
        import zenoh

        self._troubles = (ConnectionError, zenoh.ZError)
        for declare in tuple(self._declare):  # what one of them declares takes effect at once, and not twice
            declare()

    async def close(self) -> None:
        """Close the session; harmless when it never opened. One that takes longer than CLOSES_WITHIN_S is left.

        Its objects and threads end before it counts as closed: a thread that is in zenoh's code while the interpreter
        ends aborts the process.
        """
        if self._session is None:
            return
        declared: list[Any] = [self._session, self._publishers, self._held]
        self._session, self._publishers, self._held = None, {}, []
        callers, self._callers = self._callers, []
        closed, loop = asyncio.Event(), asyncio.get_running_loop()

        def close() -> None:
            try:
                declared[0].close()
            finally:
                declared.clear()  # each of them may block as well: never in the loop
                for caller in callers:
                    caller.join(CLOSES_WITHIN_S)
                call_in_loop(loop, closed.set)

        try:  # no thread of the loop's own executor: the program would wait for that one in the end
            threading.Thread(target=close, name="close the session", daemon=True).start()
        except RuntimeError:  # the program ends, or has no memory for a thread
            close()
        try:
            async with asyncio.timeout(CLOSES_WITHIN_S):
                await closed.wait()
        except TimeoutError:
            log.warning("the session at %s does not close within %g s; it is left", self.endpoint, CLOSES_WITHIN_S)

    @property
    def session_id(self) -> str:
        """Return zenoh's id of the open session; ConnectionError while it is closed."""
        return str(self._open_session.info.zid())

    @property
    def has_router(self) -> bool:
        """Whether the open session is connected to a router; a client of zenoh reconnects by itself."""
        return self._session is not None and bool(self._session.info.routers_zid())

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
        """Call `receive` in the loop for every sample; its key has no wildcards, and is that of a car's topic.

        A put may carry a wildcard ("car/*/teleop") and still reach an exact subscription; such a stray is counted, and
        so is a sample larger than max_bytes, which is dropped before its bytes are copied.
        """
        self.when_open(lambda: self._subscribe(key, receive, max_bytes))

    def answer(self, key: str, reply: Reply) -> None:
        """Answer queries on exactly this key in the loop; RefusedError becomes an error reply with its text."""
        self.when_open(lambda: self._answer(key, reply))

    def announce(self, key: str) -> None:
        """Hold a liveliness token until close."""
        self.when_open(lambda: self._held.append(self._open_session.liveliness().declare_token(key)))

    def when_open(self, declare: Callable[[], object]) -> None:
        """Call once the session is open; at once if it is."""
        self._declare.append(declare)
        if self._session is not None:
            declare()

    def watch(self, key: str, changed: Changed) -> None:
        """Call `changed(key, alive)` in the loop for every liveliness token, including those already present."""
        self.when_open(lambda: self._watch(key, changed))

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
            lambda reply: call_in_loop(loop, functools.partial(_take_reply, replies, reply)),
            lambda: call_in_loop(loop, done.set),
        )
        drop = zenoh.CongestionControl.DROP  # zenoh's default would hold up the loop while a link is full
        with self._noting_callers():
            self._open_session.get(key, collect, payload=payload, timeout=timeout_s, congestion_control=drop)
        async with asyncio.timeout(timeout_s + 1):
            await done.wait()
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
            priority=_priority(key, urgent=urgent),
            express=urgent,
        )
        self._publishers[key] = publisher
        return publisher

    def _subscribe(self, key: str, receive: Receive, max_bytes: int) -> None:
        exact = "*" not in key
        mailbox = Mailbox(self._running_loop, receive)

        def on_sample(sample: "zenoh.Sample") -> None:  # zenoh's thread
            name = str(sample.key_expr)
            if name != key if exact else not topics.fits(name, key):
                self.strays += 1
            elif len(sample.payload) > max_bytes:
                self.oversized += 1
            else:
                mailbox.post((name, sample.payload.to_bytes(), time.monotonic()))

        with self._noting_callers():
            self._held.append(self._open_session.declare_subscriber(key, on_sample))

    def _watch(self, key: str, changed: Changed) -> None:
        import zenoh

        mailbox = Mailbox(self._running_loop, changed)

        def on_token(sample: "zenoh.Sample") -> None:  # zenoh's thread
            name = str(sample.key_expr)
            if topics.fits(name, key):
                mailbox.post((name, sample.kind == zenoh.SampleKind.PUT))
            else:
                self.strays += 1

        with self._noting_callers():
            self._held.append(self._open_session.liveliness().declare_subscriber(key, on_token, history=True))

    def _answer(self, key: str, reply: Reply) -> None:
        mailbox = Mailbox(self._running_loop, functools.partial(self._reply_to, key, reply))

        def on_query(query: "zenoh.Query") -> None:  # zenoh's thread
            mailbox.post((query,))

        with self._noting_callers():
            self._held.append(self._open_session.declare_queryable(key, on_query))

    def _reply_to(self, key: str, reply: Reply, query: "zenoh.Query") -> None:
        answering = asyncio.ensure_future(_reply(key, reply, query))
        self._answering.add(answering)
        answering.add_done_callback(self._answering.discard)

    @contextmanager
    def _noting_callers(self) -> Iterator[None]:
        """Keep the threads that zenoh starts in this block, in which it calls our functions."""
        before = set(threading.enumerate())
        yield
        started = [one for one in threading.enumerate() if one not in before and CALLER in one.name]
        self._callers = [*(one for one in self._callers if one.is_alive()), *started]

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


def _take_reply(replies: "list[zenoh.Reply]", reply: "zenoh.Reply") -> None:
    """Keep an answer; one question to one car has one, and another computer may send any number."""
    if len(replies) < MAX_ANSWERS:
        replies.append(reply)


def _priority(key: str, *, urgent: bool) -> "zenoh.Priority":
    import zenoh

    if urgent:
        return zenoh.Priority.REAL_TIME
    topic = key.rpartition("/")[2]
    if topic in topics.LASTING:
        return zenoh.Priority.BACKGROUND
    return zenoh.Priority.DATA_LOW if topic in topics.BULK else zenoh.Priority.DATA_HIGH


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
