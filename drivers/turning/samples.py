"""HeadSamples of a turning lidar as its codec returns them: angles in degrees, clockwise seen from above."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from wallride.drivers.value import value

Floats = npt.NDArray[np.float64]
Count = Callable[[str], None]
"""Takes the kind of an event for the counts of a driver."""


@value(eq=False)
class HeadSamples:
    """HeadSamples in the order in which they were taken, arrays of shape (n,).

    head_deg: direction of the head, clockwise from the sensor's zero, in [0, 360). deg: direction of the measurement,
        which a triangulating sensor does not take along its head; clockwise, in [0, 360). range_m: NaN for no return.
    lost: number of samples that were in damaged frames before or among these.
    """

    head_deg: Floats
    deg: Floats
    range_m: Floats
    lost: int = 0

    @property
    def count(self) -> int:
        """Return the number of samples."""
        return int(self.head_deg.size)


class SampleDecoder(Protocol):
    """Turns the bytes of one kind of stream into samples, whatever the chunking; never raises."""

    @property
    def behind(self) -> int:
        """Number of samples that wait for later bytes."""

    def feed(self, chunk: bytes) -> HeadSamples:
        """Add bytes and return the samples that they completed."""


_NOTHING = np.empty(0)
NO_SAMPLES = HeadSamples(_NOTHING, _NOTHING, _NOTHING)


def lost_samples(number: int) -> HeadSamples:
    """Return no samples, and how many were in damaged frames."""
    return HeadSamples(_NOTHING, _NOTHING, _NOTHING, number)


def joined(parts: Sequence[HeadSamples]) -> HeadSamples:
    """Return the samples of several frames as one value."""
    if not parts:
        return NO_SAMPLES
    if len(parts) == 1:
        return parts[0]
    return HeadSamples(
        np.concatenate([part.head_deg for part in parts]),
        np.concatenate([part.deg for part in parts]),
        np.concatenate([part.range_m for part in parts]),
        sum(part.lost for part in parts),
    )


def metres(mm: npt.NDArray[np.float64]) -> Floats:
    """Return millimetres as metres, NaN where they are 0 or negative: the sensors' "no return"."""
    return np.where(mm > 0, mm / 1000.0, np.nan)
