"""The car's session: what comes in waits in small rings of zenoh's own, and the loop empties them when it has time.

No Python runs in zenoh's threads, except for the scans of `lidar.driver = "topic"` (`subscribe_prompt`). With a
callback for each message, a thread of ordinary priority could be preempted while it held the interpreter's lock, and
the thread that drives then waited for a processor that a flood kept busy: up to 0.9 s without a motor command. A ring
that is full drops its oldest message; `wallride.runtime.wire.ingress` bounds what one client can put into it.
"""

import functools
import logging
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.mailbox import PromptMailbox
from wallride.runtime.wire.network import MAX_SAMPLE_BYTES, Receive, ReceiveAttached, Reply

if TYPE_CHECKING:
    import zenoh

log = logging.getLogger("wallride.bus")

POLL_HZ: Final = 100.0
MAX_WAITING_SAMPLES: Final = 64
MAX_WAITING_QUESTIONS: Final = 16
MAX_ANSWERS_PER_POLL: Final = 2
"""Maximum number of questions of one kind that a poll answers: 200/s of all clients together."""

_Inlet = tuple[Callable[[], Any], Callable[[Any], None], int]
"""What receives one message or None without waiting, what takes it, and how many of them a poll takes."""


class CarBus(Bus):
    """A bus that delivers only in `poll`, which the loop calls POLL_HZ times a second."""

    def __init__(self, *arguments: Any, **options: Any) -> None:  # noqa: ANN401 - those of a Bus
        super().__init__(*arguments, **options)
        self._inlets: list[_Inlet] = []
        self._mailboxes: list[PromptMailbox] = []

    @property
    def routers(self) -> Mapping[str, str]:
        """Return no router: `uplink.UplinkedBus` has them."""
        return {}

    def poll(self) -> None:
        """Deliver what has come since the last time, in bounded time."""
        if self.is_open:
            for receive, take, most in self._inlets:
                one, left = receive(), most
                while one is not None:
                    take(one)
                    left -= 1
                    one = receive() if left else None

    def put_latched(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Publish a message that never changes; late subscribers get it from zenoh's cache (advanced publisher)."""
        import zenoh
        from zenoh import ext

        try:
            publisher = ext.declare_advanced_publisher(
                self._open_session,
                key,
                encoding=zenoh.Encoding(encoding),
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.BACKGROUND,  # whose queue it fits as a whole
                cache=ext.CacheConfig(max_samples=1),
                publisher_detection=True,
            )
            publisher.put(payload, attachment=attachment)
        except self._troubles as error:  # what is declared after it matters more
            log.error("late subscribers of %s get nothing: %s", key, error)
            self.dropped += 1
        else:
            self._held.append(publisher)

    async def close(self) -> None:
        """Close the session; what still waits is dropped."""
        self._held.append(self._inlets)  # what they hold ends with the session
        self._inlets = []
        await super().close()
        while self._mailboxes:
            self._mailboxes.pop().close()

    def subscribe_attached(self, key: str, receive: ReceiveAttached, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Call `receive` in `poll` for every sample of exactly this key, with its attachment."""

        def take(sample: "zenoh.Sample") -> None:
            note = sample.attachment.to_bytes() if sample.attachment is not None else None
            receive(sample.payload.to_bytes(), note, time.monotonic())

        self.when_open(lambda: self._poll_samples(key, take, max_bytes))

    def subscribe_prompt(self, key: str, receive: ReceiveAttached, *, max_bytes: int) -> None:
        """Call `receive` in the loop for every sample of exactly this key, at once instead of in `poll`.

        For a lidar's scans alone, which would be up to 10 ms older by a poll: a thread of zenoh runs Python for each.
        """
        self.when_open(lambda: self._wake_for(key, receive, max_bytes))

    def _wake_for(self, key: str, receive: ReceiveAttached, max_bytes: int) -> None:
        def take(sample: "zenoh.Sample", arrival_s: float) -> None:
            if str(sample.key_expr) != key:
                self.strays += 1
            elif len(sample.payload) > max_bytes:
                self.oversized += 1
            else:
                note = sample.attachment.to_bytes() if sample.attachment is not None else None
                receive(sample.payload.to_bytes(), note, arrival_s)

        mailbox = PromptMailbox(self._running_loop, take)
        self._mailboxes.append(mailbox)

        def on_sample(sample: "zenoh.Sample") -> None:  # zenoh's thread, which keeps the interpreter's lock for little
            mailbox.post((sample, time.monotonic()))

        with self._noting_callers():
            self._held.append(self._open_session.declare_subscriber(key, on_sample))

    def _subscribe(self, key: str, receive: Receive, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        def take(sample: "zenoh.Sample") -> None:
            receive(str(sample.key_expr), sample.payload.to_bytes(), time.monotonic())

        self._poll_samples(key, take, max_bytes)

    def _poll_samples(self, key: str, take: "Callable[[zenoh.Sample], None]", max_bytes: int) -> None:
        import zenoh

        subscriber = self._open_session.declare_subscriber(key, zenoh.handlers.RingChannel(MAX_WAITING_SAMPLES))
        self._held.append(subscriber)
        take_one = functools.partial(self._take_sample, key, take, max_bytes)
        self._inlets.append((subscriber.try_recv, take_one, MAX_WAITING_SAMPLES))

    def _take_sample(
        self, key: str, take: "Callable[[zenoh.Sample], None]", max_bytes: int, sample: "zenoh.Sample"
    ) -> None:
        name = str(sample.key_expr)
        if "*" not in key and name != key:
            self.strays += 1
        elif len(sample.payload) > max_bytes:
            self.oversized += 1
        else:
            take(sample)

    def _answer(self, key: str, reply: Reply) -> None:
        import zenoh

        queryable = self._open_session.declare_queryable(key, zenoh.handlers.RingChannel(MAX_WAITING_QUESTIONS))
        self._held.append(queryable)
        self._inlets.append((queryable.try_recv, functools.partial(self._reply_to, key, reply), MAX_ANSWERS_PER_POLL))
