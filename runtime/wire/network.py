"""What the car needs of a network, and what a network may refuse; `bus` implements it with zenoh."""

from collections.abc import Awaitable, Callable, Mapping
from typing import Protocol

JSON = "application/json"
CDR = "application/cdr"
BYTES = "application/octet-stream"

Receive = Callable[[str, bytes, float], None]
"""key, payload, arrival_s on the monotonic clock."""
ReceiveAttached = Callable[[bytes, bytes | None, float], None]
"""payload, attachment, arrival_s on the monotonic clock."""
Reply = Callable[[bytes], bytes | Awaitable[bytes]]
Changed = Callable[[str, bool], None]

MAX_SAMPLE_BYTES = 96 << 10
"""Maximum size of an accepted sample. Telemetry's largest is a map, which is made to fit."""


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

    @property
    def is_open(self) -> bool:
        """Whether the session is open, so that `put` sends."""

    @property
    def dropped(self) -> int:
        """Number of samples put while it was closed."""

    @property
    def routers(self) -> Mapping[str, str]:
        """Why nothing goes to a router of the fleet, by its address; "" while it does."""

    @property
    def session_id(self) -> str:
        """Return zenoh's id of the open session."""

    def put(self, key: str, payload: bytes, *, encoding: str = JSON, urgent: bool = False) -> None:
        """Publish without waiting."""

    def put_attached(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Publish with an attachment, without waiting."""

    def put_latched(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Publish, and keep the message for late subscribers."""

    def wanted(self, key: str, *, encoding: str = JSON, urgent: bool = False) -> bool:
        """Tell whether the key has a subscriber."""

    def subscribe(self, key: str, receive: Receive, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Subscribe to a key."""

    def subscribe_attached(self, key: str, receive: ReceiveAttached, *, max_bytes: int = MAX_SAMPLE_BYTES) -> None:
        """Subscribe to a key whose samples carry attachments."""

    def subscribe_prompt(self, key: str, receive: ReceiveAttached, *, max_bytes: int) -> None:
        """Subscribe to such a key without waiting for a poll."""

    def answer(self, key: str, reply: Reply) -> None:
        """Answer queries on a key."""

    def announce(self, key: str) -> None:
        """Hold a liveliness token."""

    def when_open(self, declare: Callable[[], None]) -> None:
        """Call once the session is open."""

    def poll(self) -> None:
        """Deliver what has come in."""
