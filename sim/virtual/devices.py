"""In-memory devices for stories in virtual time: no sockets, no threads, no real seconds."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from typing import Never

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock, Drive, Health, LinkState, MotorState, Scan

BEAMS = 1081
STEP_RAD = math.radians(0.25)
FLICKER_M = np.float32(0.0005)


class MemoryLidar:
    """Delivers `ranges_at(now_s)` at a steady rate; None from it is a missing scan.

    late_s: how long a scan waits in a buffer before it is delivered; its stamp stays that of the measurement.
    frozen: repeats a scan bit for bit. A measuring sensor never does: the same ranges vary by half a millimetre.
    ray_s: as in its scans.
    """

    def __init__(
        self, ranges_at: Callable[[float], npt.NDArray[np.float32] | None], clock: Clock, rate_hz: float = 40.0
    ) -> None:
        self._ranges_at = ranges_at
        self._clock = clock
        self._period_s = 1 / rate_hz
        self.late_s = 0.0
        self.frozen = False
        self.ray_s = 0.0
        self._health = Health(LinkState.READY, "in memory", "twin")

    @property
    def health(self) -> Health:
        """Return the present condition; tests change it."""
        return self._health

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver for ever."""
        sequence, last_m, given_m = 0, None, None
        while True:
            await asyncio.sleep(self._period_s)
            now_s = self._clock()
            ranges_m = self._ranges_at(now_s)
            if ranges_m is not None:
                if self.frozen and last_m is not None:
                    ranges_m = last_m
                elif given_m is not None and np.array_equal(ranges_m, given_m, equal_nan=True):
                    flicker_m = np.random.default_rng(sequence).uniform(0, FLICKER_M, ranges_m.size)
                    given_m, ranges_m = ranges_m, (ranges_m + flicker_m).astype(np.float32)
                else:
                    given_m = ranges_m
                last_m = ranges_m
                stamp_s = now_s - self.late_s
                first_rad = -STEP_RAD * (BEAMS // 2)
                on_scan(Scan(stamp_s, now_s, first_rad, STEP_RAD, 0.02, 30.0, ranges_m, sequence, self.ray_s))
            sequence += 1


class MemoryMotor:
    """Accepts and records every command; its wheels follow at once.

    wire: (time, drive) of every command taken.
    present: False is an unplugged controller: it takes nothing and reports nothing.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.wire: list[tuple[float, Drive]] = []
        self.present = True
        self.fault = ""
        self._fault_gone = True
        self._health = Health(LinkState.READY, "in memory", "twin")
        self._distance_m = 0.0
        self._last = (clock(), Drive(0.0, 0.0))

    @property
    def health(self) -> Health:
        """Return the present condition."""
        self._health.link = LinkState.READY if self.present else LinkState.ABSENT
        return self._health

    @property
    def state(self) -> MotorState | None:
        """Return the state that a controller would report."""
        if not self.present:
            return None
        now_s = self._clock()
        since_s, drive = self._last
        self._distance_m += (now_s - since_s) * drive.speed_mps
        self._last = (now_s, drive)
        return MotorState(
            stamp_s=now_s,
            speed_mps=drive.speed_mps,
            distance_m=self._distance_m,
            steering_rad=drive.steering_rad,
            voltage_v=11.8,
            motor_current_a=0.0,
            input_current_a=0.0,
            temperature_c=25.0,
            fault=self.fault,
        )

    @property
    def braked_instead(self) -> bool:
        """It obeys every command."""
        return False

    async def run(self) -> Never:
        """Stay connected; brake when cancelled, as a driver does."""
        try:
            await asyncio.Event().wait()  # a connected motor has no other work
            raise AssertionError("unreachable: that event is never set")
        finally:
            self.send(Drive(0.0, 0.0))

    def send(self, drive: Drive) -> bool:
        """Record the command."""
        if not self.present:
            return False
        self._last = (self._clock(), drive)
        self.wire.append((self._clock(), drive))
        return True

    def inject_fault(self, text: str, *, lasting: bool = False) -> None:
        """Report a fault; a lasting one comes back after it was cleared."""
        self.fault = text
        self._fault_gone = not lasting

    def latch_fault(self, words: str) -> None:
        """Latch a fault found elsewhere."""
        self.fault = self.fault or words

    def retry_fault(self) -> None:
        """Clear the fault if its cause is gone: it was the device's own."""
        self.clear_fault()

    def clear_fault(self) -> None:
        """Clear the fault if its cause is gone."""
        if self._fault_gone:
            self.fault = ""


def ranges_between_walls(left_m: float, right_m: float, ahead_m: float = math.nan) -> npt.NDArray[np.float32]:
    """Return the noise-free scan of a car that stands parallel between two endless walls, with one ahead or NaN."""
    bearing_rad = (np.arange(BEAMS) - BEAMS // 2) * STEP_RAD
    with np.errstate(divide="ignore", invalid="ignore"):
        sides_m = np.where(bearing_rad > 0, left_m / np.sin(bearing_rad), -right_m / np.sin(bearing_rad))
        front_m = np.where(np.cos(bearing_rad) > 0, ahead_m / np.cos(bearing_rad), np.nan)
    ranges_m = np.fmin(np.where(np.isfinite(sides_m), sides_m, np.nan), front_m)
    ranges_m[~(ranges_m < 30.0)] = np.nan  # comparisons with NaN are false
    return ranges_m.astype(np.float32)


class MemoryBus:
    """Records published messages, delivers the messages of a story, and issues its queries.

    heard: (key, payload) of everything put. listened_to: whether it has subscribers.
    """

    endpoint = "memory"
    session_id = "0"
    routers: Mapping[str, str] = {}
    is_open = True
    dropped = 0

    def __init__(self, clock: Clock, *, listened_to: bool = True) -> None:
        self._clock = clock
        self._listened_to = listened_to
        self._readers: dict[str, Callable[[str, bytes, float], None]] = {}
        self._replies: dict[str, Callable[[bytes], bytes | Awaitable[bytes]]] = {}
        self.heard: list[tuple[str, bytes]] = []
        self.tokens: set[str] = set()

    def put(self, key: str, payload: bytes, *, encoding: str = "", urgent: bool = False) -> None:  # noqa: ARG002 - a Bus
        """Record the message."""
        self.heard.append((key, payload))

    def put_attached(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:  # noqa: ARG002 - a Bus
        """Record the message."""
        self.heard.append((key, payload))

    put_latched = put_attached

    def when_open(self, declare: Callable[[], None]) -> None:
        """Call at once."""
        declare()

    def wanted(self, key: str, *, encoding: str = "", urgent: bool = False) -> bool:  # noqa: ARG002 - a Bus
        """Return whether there is a subscriber."""
        return self._listened_to

    def subscribe(self, key: str, receive: Callable[[str, bytes, float], None], *, max_bytes: int = 0) -> None:  # noqa: ARG002 - a Bus
        """Register the car's subscriber for messages of `deliver`."""
        self._readers[key] = receive

    def subscribe_attached(
        self, key: str, receive: Callable[[bytes, bytes | None, float], None], *, max_bytes: int = 0  # noqa: ARG002 - a Bus
    ) -> None:  # fmt: skip
        """Register the car's subscriber for messages without an attachment of `deliver`."""
        self._readers[key] = lambda _key, payload, arrival_s: receive(payload, None, arrival_s)

    subscribe_prompt = subscribe_attached

    def answer(self, key: str, reply: Callable[[bytes], bytes | Awaitable[bytes]]) -> None:
        """Register the car's handler for queries of `ask`."""
        self._replies[key] = reply

    def announce(self, key: str) -> None:
        """Hold a token."""
        self.tokens.add(key)

    def poll(self) -> None:
        """Do nothing: messages of a story are delivered at once."""

    def deliver(self, key: str, payload: bytes) -> None:
        """Deliver a message to the car now."""
        self._readers[key](key, payload, self._clock())

    async def ask(self, key: str, payload: bytes = b"") -> bytes:
        """Query the car."""
        answer = self._replies[key](payload)
        return answer if isinstance(answer, bytes) else await answer
