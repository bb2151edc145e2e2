"""From samples to turns of the head, each with the time of every sample. No port, no clock of its own.

A turn begins and ends behind the car, so that what lies ahead was measured in one piece. The samples of a chunk were
taken one sample time apart, the last one when the chunk was read: a chunk that waited in a buffer spans the time that
it waited.

The sensors do not send their time. Their delay is the excess of the arrival over the number of samples, which a
crystal counts: samples that come later than their number allows have waited on the way, until as many come at once. A
constant delay from the first sample on is not visible this way; the quickest answer of the link bounds it (`least_s`),
unless the link became late after that. The time before the first sample tells nothing: the head may spin up.
"""

import math
from typing import Final

import numpy as np

from wallride.drivers.turning.samples import Count, Floats, HeadSamples, joined
from wallride.drivers.value import value

LONGEST_TURN_S: Final = 0.5
"""Duration of the longest turn: a head slower than 2 Hz is a stalled motor, and its samples are dropped."""
DRIFT: Final = 0.002
"""Maximum error of the sample time once it is measured. It also bounds how fast a delay that lasts is forgotten."""
RATE_ERROR: Final = 0.05
"""Maximum error of the nominal sample time. It is measured turn by turn."""
_GAIN, _STEP = 0.05, 0.02
"""Share of a turn's deviation, limited to the second number, by which the measured sample time follows."""
_HALF_TURN_DEG: Final = 180.0


@value(eq=False)
class Turn:
    """HeadSamples of one turn of the head, arrays of shape (n,).

    deg: clockwise from the sensor's zero. ago_s: time from the sample to the end of the turn. end_s: monotonic time at
    which the last one was taken, delay of the link included. late_s: that delay. duration_s: from first to last.
    """

    deg: Floats
    range_m: Floats
    ago_s: Floats
    end_s: float
    late_s: float
    duration_s: float


class Turns:
    """Collects samples into turns.

    sample_s: nominal time between two samples. cut_deg: direction of the head at which a turn begins, clockwise.
    least_s: the shortest delay that a sample can have.

    Counts "endless turn": the head does not turn.
    """

    def __init__(self, sample_s: float, cut_deg: float, count: Count, *, least_s: float = 0.0) -> None:
        self._cut_deg = cut_deg
        self._count = count
        self._lateness = _Lateness(sample_s, least_s)
        self._parts: list[HeadSamples] = []
        self._times: list[Floats] = []
        self._position_deg = math.nan
        self._begun = False
        self._was_opposite = True

    @property
    def sample_s(self) -> float:
        """Return the time between two samples as measured so far."""
        return self._lateness.sample_s

    def add(self, samples: HeadSamples, read_at_s: float) -> list[Turn]:
        """Add samples, the last of which was read at a time, and return the turns that they completed."""
        late_s = self._lateness.note(samples.count + samples.lost, read_at_s)
        if not samples.count:
            return []
        times_s = np.arange(1.0 - samples.count, 1.0) * self.sample_s + (read_at_s - late_s)
        position_deg = (samples.head_deg - self._cut_deg) % 360.0
        before_deg = np.concatenate(([self._position_deg], position_deg[:-1]))
        cuts = self._cuts(before_deg, position_deg)
        self._position_deg = float(position_deg[-1])
        turns, first = [], 0
        if cuts:
            self._lateness.learn(read_at_s)
        for cut in [*cuts, samples.count]:
            if cut > first:
                self._parts.append(_part(samples, first, cut))
                self._times.append(times_s[first:cut])
            if cut < samples.count:
                if self._begun and self._parts:
                    turns.append(self._close(late_s))
                self._parts, self._times, self._begun = [], [], True
            first = cut
        if sum(part.count for part in self._parts) * self.sample_s > LONGEST_TURN_S:
            self._count("endless turn")
            self._forget()
        return turns

    def _cuts(self, before_deg: Floats, position_deg: Floats) -> list[int]:
        """Return where turns end: a head that was not opposite since the last cut has gone back and forth over it."""
        opposite, found, begin = np.abs(position_deg - _HALF_TURN_DEG) < _HALF_TURN_DEG / 2, list[int](), 0
        for cut in np.flatnonzero(before_deg - position_deg > _HALF_TURN_DEG).tolist():
            if self._was_opposite or opposite[begin:cut].any():
                found.append(cut)
                self._was_opposite, begin = False, cut
        self._was_opposite = self._was_opposite or bool(opposite[begin:].any())
        return found

    def _close(self, late_s: float) -> Turn:
        samples, times_s = joined(self._parts), np.concatenate(self._times)
        end_s = float(times_s[-1])
        ago_s = np.maximum(end_s - times_s, 0.0)
        return Turn(samples.deg, samples.range_m, ago_s, end_s, late_s, float(ago_s[0]))

    def _forget(self) -> None:
        self._parts, self._times, self._begun = [], [], False
        self._position_deg = math.nan


class _Lateness:
    """Delay of the newest samples: arrival less their number, above the smallest such excess so far."""

    def __init__(self, sample_s: float, least_s: float) -> None:
        self._nominal_s = self.sample_s = sample_s
        self._least_s = least_s
        self._excess_s = 0.0
        self._read_s = math.nan
        self._learnt_s = math.nan
        self._since = 0

    def note(self, samples: int, read_at_s: float) -> float:
        """Count samples that have arrived, and return their delay."""
        if math.isnan(self._read_s):
            if not samples:
                return self._least_s
            self._read_s = read_at_s
        elapsed_s, self._read_s = read_at_s - self._read_s, read_at_s
        self._since += samples
        slip_s = elapsed_s * (1 - DRIFT) - samples * self.sample_s
        self._excess_s = max(0.0, self._excess_s + slip_s)
        return self._least_s + self._excess_s

    def learn(self, read_at_s: float) -> None:
        """Measure the sample time over the turn that ends now."""
        if self._since and math.isfinite(self._learnt_s):
            off = (read_at_s - self._learnt_s) / self._since / self.sample_s - 1.0
            followed_s = self.sample_s * (1.0 + _GAIN * min(max(off, -_STEP), _STEP))
            self.sample_s = min(max(followed_s, self._nominal_s * (1 - RATE_ERROR)), self._nominal_s * (1 + RATE_ERROR))
        self._learnt_s, self._since = read_at_s, 0


def _part(samples: HeadSamples, first: int, last: int) -> HeadSamples:
    if first == 0 and last == samples.count:
        return samples
    part = slice(first, last)
    return HeadSamples(samples.head_deg[part], samples.deg[part], samples.range_m[part])
