"""What the laps teach the steering: where the car was beside the line, it aims to the other side in the next lap.

Iterative learning control (Bristow, Tharayil & Alleyne 2006): for each piece of the line, all of equal time

    aim <- smoothed(KEPT * aim - GAIN * error a moment later)

Tyres, a floor or a servo other than assumed bring the car off the line at the same places in every lap. The feedback
alone does not take that out: it is as stiff as the lag of the turn allows.
"""

from typing import Final

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.perception.geometry import Floats

PIECE_S: Final = 0.05
"""Time of the line at its own speed that is one piece."""
GAIN, KEPT = 0.7, 0.95
"""Share of an error that one lap takes out, and of the aim that the next lap keeps: what was once learnt fades."""
LEAD_S: Final = 0.3
"""Time after which the car is where it was aimed: about the lag of the feedback."""
BESIDE: Final = 5
SMOOTHING: Final = np.hanning(2 * BESIDE + 3)[1:-1] / (BESIDE + 1)
"""Weights of a piece and its neighbours: what changes faster than in half a second the car cannot follow, and would
swing."""
MOST_M: Final = 0.03
"""Largest aim: a car that slides off its line is not helped by steering more."""
AT_SPEED: Final = 0.85
"""Share of the asked speed from which an error counts: that of a car that was held back is of another bend."""

AT_END_RAD, AT_GRIP = 0.01, 0.8
"""Angle from the end of the steering, and share of the grip, beyond which an error teaches nothing: the car did not do
what it was told, and telling it more makes it swing."""


class LapCorrection:
    """Aims beside a line; 0 everywhere in the first lap."""

    def __init__(self, line: CourseLine) -> None:
        along_m = np.append(line.along_m, line.length_m)
        speeds_mps = np.append(line.speed_mps, line.speed_mps[0])
        takes_s = 2.0 * np.diff(along_m) / (speeds_mps[1:] + speeds_mps[:-1])
        self._length_m = line.length_m
        self._along_m, self._pieces = along_m, np.append(0.0, takes_s.cumsum()) / PIECE_S
        self._pieces *= max(2 * BESIDE, round(self._pieces[-1])) / self._pieces[-1]
        self._aim_m: Floats = np.zeros(round(self._pieces[-1]))
        self._begin()

    def _begin(self) -> None:
        """Forget the errors of this lap, not what the earlier ones have taught."""
        self._sum_m: Floats = np.zeros_like(self._aim_m)
        self._scans: Floats = np.zeros_like(self._aim_m)

    def _piece(self, along_m: float) -> float:
        return float(np.interp(along_m % self._length_m, self._along_m, self._pieces))

    def aim_m(self, along_m: float, share: float) -> float:
        """Return where to aim beside the line, left positive, at a share of the line's speed."""
        whole, part = divmod(self._piece(along_m), 1.0)
        first, last = (float(self._aim_m[(int(whole) + k) % self._aim_m.size]) for k in (0, 1))
        return min(max(share * (first + part * (last - first)), -MOST_M), MOST_M)

    def take(self, along_m: float, aside_m: float, share: float) -> None:
        """Take in the place on the line at a scan; the error is expected to grow with the share of the line's speed."""
        piece = round(self._piece(along_m) - share * LEAD_S / PIECE_S) % self._aim_m.size
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
