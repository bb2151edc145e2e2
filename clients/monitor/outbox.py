"""Queue of one page: the newest of every topic, in bundles, of which one is in transit at a time. Pure.

A page that is slow, asleep or far away delays only itself: what it could not take in time is replaced by what is newer,
and nothing piles up. A bundle is a WebSocket message: a number (uint32, little endian) and records of topic (uint8),
a zero, the payload's age in milliseconds (uint16), its length (uint32), and its bytes, padded to four. The page
acknowledges the number. Number 0 wants no acknowledgement.
"""

import math
import struct
from collections.abc import Mapping

from wallride.runtime.wire import topics

PILOT, MONITOR, FLEET, CALIBRATION, LAP_MAP = "pilot", "monitor", "fleet", "calibration", "lap_map"
"""Topics of the monitor itself, in JSON: the state of the page's driver, that of the relay, all cars, the page's
calibration, and the map of a lap."""
TOPICS = (
    topics.SCAN, topics.WALL, topics.FOOTPRINT, topics.ODOM, topics.OUTPUT, topics.DISTANCE_ERROR, topics.STATUS,
    topics.DECISION, topics.BEAT, topics.POSE, topics.MAP, topics.LINE, PILOT, MONITOR, FLEET, CALIBRATION,
    LAP_MAP,
)  # fmt: skip
FROM_CAR = TOPICS[: TOPICS.index(PILOT)]
EAGER = frozenset({topics.SCAN, topics.DECISION, PILOT})
"""Topics that cause a bundle of their own; the others are collected for at most LAZY_S."""
LAZY_S = 0.05
GIVE_UP_S = 2.0
"""Timeout of an acknowledgement, after which the page gets the next bundle anyway; TCP reports a lost page."""
_INDEX: Mapping[str, int] = {topic: index for index, topic in enumerate(TOPICS)}
_HEAD = struct.Struct("<I")
_RECORD = struct.Struct("<BBHI")
_MAX_AGE_MS = 0xFFFF


class Outbox:
    """Times are monotonic seconds, given by the caller. replaced: payloads that a newer one overtook."""

    def __init__(self) -> None:
        self._waiting: dict[str, tuple[bytes, float]] = {}
        self._eager = False
        self._number = 0
        self._on_its_way = False
        self._sent_s = -math.inf
        self.replaced = 0

    def put(self, topic: str, payload: bytes, arrival_s: float) -> None:
        """Queue a payload in place of the last one of its topic."""
        self.replaced += topic in self._waiting
        self._waiting[topic] = (payload, arrival_s)
        self._eager = self._eager or topic in EAGER

    def acknowledge(self, number: int) -> None:
        """Process the page's acknowledgement of a bundle; an old number has no effect."""
        if number == self._number:
            self._on_its_way = False

    def clear(self) -> None:
        """Drop the queue, because the page watches another car now."""
        self._waiting.clear()
        self._eager = False

    def due_in_s(self, now_s: float) -> float:
        """Return how long to wait until `take`; 0 is now, infinity means until the next `put` or `acknowledge`."""
        if not self._waiting:
            return math.inf
        if self._on_its_way:
            return max(0.0, self._sent_s + GIVE_UP_S - now_s)
        return 0.0 if self._eager else max(0.0, self._sent_s + LAZY_S - now_s)

    def take(self, now_s: float) -> bytes:
        """Return the whole queue as one bundle, which is then in transit."""
        self._number = self._number % 0xFFFF_FFFF + 1
        bundle = pack(self._number, self._waiting, now_s)
        self._waiting.clear()
        self._eager, self._on_its_way, self._sent_s = False, True, now_s
        return bundle


def pack(number: int, payloads: Mapping[str, tuple[bytes, float]], now_s: float) -> bytes:
    """Return a bundle; payloads by topic, each with its arrival."""
    parts = [_HEAD.pack(number)]
    for topic, (payload, arrival_s) in payloads.items():
        age_ms = min(max(0, round((now_s - arrival_s) * 1000)), _MAX_AGE_MS)
        parts += (_RECORD.pack(_INDEX[topic], 0, age_ms, len(payload)), payload, bytes(-len(payload) % 4))
    return b"".join(parts)
