"""What the laps teach the steering: where the car was beside the line, it aims to the other side in the next lap.

Iterative learning control (Bristow, Tharayil & Alleyne 2006): for each piece of the line

    aim <- smoothed(KEPT * aim - GAIN * error a moment later)

Tyres, a floor or a servo other than assumed bring the car off the line at the same places in every lap. The feedback
alone does not take that out: it is as stiff as the lag of the turn allows.
"""

from typing import Final

import numpy as np

from wallride.runtime.control.perception.geometry import Floats

PIECE_M: Final = 0.25
GAIN, KEPT = 0.7, 0.95
"""Share of an error that one lap takes out, and of the aim that the next lap keeps: what was once learnt fades."""
LEAD_S: Final = 0.25
"""Time after which the car is where it was aimed: about the lag of the feedback."""
BESIDE: Final = 3
SMOOTHING: Final = np.hanning(2 * BESIDE + 3)[1:-1] / (BESIDE + 1)
"""Weights of a piece and its neighbours: what changes faster along the way the car cannot follow, and would swing."""
MOST_M: Final = 0.1
"""Largest aim: a car that slides off its line is not helped by steering more."""
AT_SPEED: Final = 0.85
"""Share of the asked speed from which an error counts: that of a car that was held back is of another bend."""


class LapCorrection:
    """Aims beside a line of `length_m`; 0 everywhere in the first lap."""

    def __init__(self, length_m: float) -> None:
        pieces = max(2 * BESIDE, round(length_m / PIECE_M))
        self._piece_m = max(length_m, PIECE_M) / pieces
        self._aim_m: Floats = np.zeros(pieces)
        self._begin()

    def _begin(self) -> None:
        """Forget the errors of this lap, not what the earlier ones have taught."""
        self._sum_m: Floats = np.zeros_like(self._aim_m)
        self._scans: Floats = np.zeros_like(self._aim_m)

    def aim_m(self, along_m: float, share: float) -> float:
        """Return where to aim beside the line, left positive, at a share of the line's speed."""
        whole, part = divmod(along_m / self._piece_m, 1.0)
        first, last = (float(self._aim_m[(int(whole) + k) % self._aim_m.size]) for k in (0, 1))
        return min(max(share * (first + part * (last - first)), -MOST_M), MOST_M)

    def take(self, along_m: float, aside_m: float, speed_mps: float, share: float) -> None:
        """Take in the place on the line at a scan; the error is expected to grow with the share of the line's speed."""
        piece = round((along_m - LEAD_S * speed_mps) / self._piece_m) % self._aim_m.size
        self._sum_m[piece] += aside_m / share
        self._scans[piece] += 1.0

    def lap_done(self) -> None:
        """Learn from the lap that is done. A piece between others has their error where it had no scan itself."""
        seen = self._scans.nonzero()[0]
        if seen.size:
            every, mean_m = np.arange(self._aim_m.size), self._sum_m[seen] / self._scans[seen]
            aim_m = KEPT * self._aim_m - GAIN * np.interp(every, seen, mean_m, period=every.size)
            around = np.concatenate([aim_m[-BESIDE:], aim_m, aim_m[:BESIDE]])
            self._aim_m = np.clip(np.convolve(around, SMOOTHING, "valid"), -MOST_M, MOST_M)
        self._begin()
