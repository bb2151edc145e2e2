"""The hot path: from the bytes of a running stream to scans, inside the reader callback. No log, no formatting."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Correction, Health, LinkState, Scan
from wallride.drivers.turning.grid import AskMotion, Motion, Mount, cells_for, resample
from wallride.drivers.turning.repetition import Repetition
from wallride.drivers.turning.samples import SampleDecoder
from wallride.drivers.turning.turns import Turn, Turns
from wallride.drivers.value import value

SETTLING_TURNS: Final = 2
"""Number of turns before the first scan: they tell the speed of the head, and with it the grid."""
SPARSE_TURNS: Final = 10
"""Number of turns in a row with fewer samples than the grid needs after which another grid is chosen."""


@value(eq=False)
class StreamFacts:
    """A stream that was started. sample_s: nominal. summary: the sensor in a few words. rest: its first bytes."""

    decoder: SampleDecoder
    sample_s: float
    range_min_m: float
    range_max_m: float
    summary: str
    rest: bytes = b""


@value(eq=False)
class Turning:
    """How turns are taken. stale_after_s: maximum delay. link_s: the least delay of the link."""

    mount: Mount
    stale_after_s: float
    link_s: float
    motion: AskMotion


class TurnStream:
    """One stream, from its first byte to its end.

    heard_s: when the last turn was complete, late ones included. delivered_s: of the last delivered scan. Both None
    before the first. turns_hz: measured speed of the head. beams: of a scan, 0 before it is known, and where a turn has
    too few samples. late_s: delay of the newest turn. repetition: whether it still measures.
    """

    def __init__(
        self,
        facts: StreamFacts,
        turned: Turning,
        health: Health,
        take_number: Callable[[], int],
        on_scan: Callable[[Scan], None],
    ) -> None:
        self._facts = facts
        self._mount = turned.mount
        self._stale_after_s = turned.stale_after_s
        self._motion = turned.motion
        self._health = health
        self._take_number = take_number
        self._on_scan = on_scan
        least_s = turned.link_s + facts.decoder.behind * facts.sample_s
        self._turns = Turns(facts.sample_s, turned.mount.cut_deg, health.count, least_s=least_s)
        self._settling = SETTLING_TURNS
        self._sparse, self._end_s = 0, -math.inf
        self.repetition = Repetition()
        self.heard_s: float | None = None
        self.delivered_s: float | None = None
        self.turns_hz = math.nan
        self.late_s = 0.0
        self.beams = 0

    def on_bytes(self, chunk: bytes, read_at_s: float) -> None:
        """Take bytes of the stream."""
        for turn in self._turns.add(self._facts.decoder.feed(chunk), read_at_s):
            self._on_turn(turn, read_at_s)

    def _on_turn(self, turn: Turn, read_at_s: float) -> None:
        self.heard_s, self.late_s = read_at_s, turn.late_s
        self.turns_hz = 1.0 / (turn.duration_s + self._turns.sample_s)
        number, samples = self._take_number(), turn.deg.size
        if self._settling:
            self._settling -= 1
            self._health.count("settling")
            self.beams = cells_for(samples)
            return
        if turn.late_s > self._stale_after_s:
            self._health.count("stale")
            return
        if turn.end_s <= self._end_s:  # more samples came at once than the time allows
            self._health.count("too fast")
            return
        self._end_s = turn.end_s
        self._fit(samples)
        if not self.beams:
            self._health.count("sparse")
            return
        motion = self._motion()
        if self.repetition.is_stored(turn.range_m, motion.x_mps, turn.duration_s):
            self._health.count("stored turn")
            return
        self.delivered_s = read_at_s
        if self._health.link is not LinkState.READY:
            self._health.link = LinkState.READY
            self._health.message = self._facts.summary
        self._on_scan(
            Scan(
                stamp_s=turn.end_s,
                received_s=read_at_s,
                angle_min_rad=-math.pi,
                angle_step_rad=math.tau / self.beams,
                range_min_m=self._facts.range_min_m,
                range_max_m=self._facts.range_max_m,
                ranges_m=self._ranges_m(turn, motion),
                sequence=number,
                correction=self._correction(turn, motion),
            )
        )

    def _ranges_m(self, turn: Turn, motion: Motion) -> npt.NDArray[np.float32]:
        return resample(turn, motion, self._mount, self.beams, self._facts.range_min_m, self._facts.range_max_m)

    def _correction(self, turn: Turn, motion: Motion) -> Correction:
        ray_s = turn.duration_s / self.beams * (1.0 if self._mount.upside_down else -1.0)
        return Correction(motion.x_mps, motion.y_mps, motion.yaw_rate_radps, ray_s)

    def _fit(self, samples: int) -> None:
        """Choose another grid where the head turns faster for a while than the grid allows."""
        self._sparse = self._sparse + 1 if samples < self.beams or not self.beams else 0
        if self._sparse >= SPARSE_TURNS:
            self._sparse, self.beams = 0, cells_for(samples)
            self._health.count("another grid")
