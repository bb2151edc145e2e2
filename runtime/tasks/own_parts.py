"""Persistence of the car's own parts between runs: loaded before the first scan, written when they have changed."""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Never

import numpy as np

from wallride.drivers.api import Clock, Scan
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.perception.geometry import median
from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.control.perception.window_dirt import groups
from wallride.runtime.recording import own_parts_memory as memory
from wallride.runtime.recording.own_parts_memory import RememberedParts
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError

LOOKS_EVERY_S = 2.0
UNCHANGED_S = 10.0
"""Time without a change after which a set of parts is written."""


class OwnPartsKeeper:
    """Passes known parts to the laws once the lidar has identified itself, and writes them when they have changed.

    lidar: returns the identity that the lidar reports. date: civil time as text. adopted: called with the parts that
        the laws received, for the decision log.
    """

    def __init__(
        self, car: str, lidar: Callable[[], str], laws: LiveLaws, file: Path | None, clock: Clock,
        date: Callable[[], str], is_standing: Callable[[], bool],
        adopted: Callable[[KnownParts | None], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self._car, self._lidar, self._laws, self._file = car, lidar, laws, file
        self._clock, self._date, self._is_standing, self._adopted = clock, date, is_standing, adopted
        self._stored = memory.read(file) if file is not None else None
        self._met = ""
        self._changes, self._changed_s = laws.own_parts_changes, clock()
        self._dirty = False

    def meet(self, _scan: Scan) -> None:
        """Load the known parts before a scan is judged; another lidar sees other parts of the car."""
        identity = self._lidar()
        if identity is self._met or identity == self._met:
            return
        stored = self._stored
        known = stored.parts if stored is not None and (stored.car, stored.lidar) == (self._car, identity) else None
        if known is not None or self._met:
            self._hand_over(known)
        self._met = identity

    def forget(self) -> None:
        """Forget all parts of the car, and all dirt; RefusedError while the car moves."""
        if not self._is_standing():
            raise RefusedError("the car moves: stop it, then let it forget its own parts")
        self._hand_over(None)
        self._stored, self._dirty = None, True

    async def keep(self) -> Never:
        """Write changes, in a thread."""
        while True:
            await asyncio.sleep(LOOKS_EVERY_S)
            if self.is_due() and self._file is not None:
                await asyncio.to_thread(memory.write, self._file, self._stored)

    def is_due(self) -> bool:
        """Return whether the file has to be written now; takes the parts that are to be written."""
        now_s, changes = self._clock(), self._laws.own_parts_changes
        if changes != self._changes:
            self._changes, self._changed_s = changes, now_s
            self._dirty = True
        known = self._laws.own_parts
        if not self._dirty or now_s - self._changed_s < UNCHANGED_S:
            return False
        self._dirty = False
        if known is not None and known.ranges_m:
            self._stored = RememberedParts(self._car, self._met, self._date(), known)
        return True

    def status(self) -> Mapping[str, Any]:
        """Return the known parts as patches (beams, bearing in degrees, range in m), and the date of storage."""
        known, stored = self._laws.own_parts, self._stored
        return {
            "patches": [] if known is None else _patches(known),
            "remembered": stored.at if stored is not None and stored.lidar == self._met else "",
            "lidar": self._met,
            "file": str(self._file) if self._file is not None else "",
        }

    def answer_show(self, _payload: bytes) -> bytes:
        """Return the status, for `wallride own-parts show`."""
        return topics.encode(self.status())

    def answer_forget(self, _payload: bytes) -> bytes:
        """Forget the parts and return the status; for `wallride own-parts forget`."""
        self.forget()
        return topics.encode(self.status())

    def _hand_over(self, known: KnownParts | None) -> None:
        self._laws.remember_own_parts(known)
        self._adopted(known)


def _patches(known: KnownParts) -> list[dict[str, float]]:
    beam = np.array([beam for beam, _ in known.ranges_m], np.intp)
    range_m = np.array([range_m for _, range_m in known.ranges_m])
    bearing_deg = np.degrees(known.angle_min_rad + known.angle_step_rad * beam)
    return [
        {
            "beams": group.size,
            "bearing_deg": round(float(bearing_deg[group].mean()), 1),
            "range_m": round(median(range_m[group]), 2),
        }
        for group in groups(beam)
    ]
