"""Speed of the car over the ground while locked wheels report that it stands."""

import math
from typing import Final

LONGEST_S: Final = 0.06
"""Longest time between two reports that counts, of a VESC that is asked 50 times a second and misses two."""


class SlidingSpeed:
    """Estimates the speed of the car while locked wheels report 0 and the car still slides.

    A rolling car decelerates by at most rolls_mps2; a report that falls faster comes from locking wheels. From then on
    the car is assumed to decelerate as on a slippery floor, by slides_mps2, until the wheels reach that speed again.
    (With the deceleration of a good floor the brake was released on a bad one while the car still moved at 2.5 m/s.)

    slides: whether the wheels are estimated to be locked now.
    """

    def __init__(self, rolls_mps2: float, slides_mps2: float) -> None:
        self._rolls_mps2 = rolls_mps2
        self._slides_mps2 = slides_mps2
        self._signed_mps = 0.0
        self._stamp_s = -math.inf
        self.slides = False

    def tune(self, rolls_mps2: float, slides_mps2: float) -> None:
        """Change the decelerations of the floor; the sliding state is kept."""
        self._rolls_mps2 = rolls_mps2
        self._slides_mps2 = slides_mps2

    def update(self, reported_mps: float | None, stamp_s: float, since_report_s: float = 0.0) -> float:
        """Return the signed speed at this scan; None (no report) counts as locked wheels.

        since_report_s: from the report of the last scan to that of this one: there may be another between them.
        """
        signed_mps = reported_mps or 0.0
        size_mps, last_mps = abs(signed_mps), abs(self._signed_mps)
        elapsed_s = stamp_s - self._stamp_s if stamp_s > self._stamp_s else 0.0
        self._stamp_s = stamp_s
        falls_s = max(elapsed_s, min(since_report_s, LONGEST_S))
        if self.slides or size_mps < last_mps - self._rolls_mps2 * falls_s:
            slowest_mps = max(0.0, last_mps - self._slides_mps2 * elapsed_s)
            self.slides = not size_mps >= slowest_mps  # NaN counts as sliding
            if self.slides:
                signed_mps = math.copysign(slowest_mps, self._signed_mps)
        self._signed_mps = signed_mps
        return signed_mps
