"""Score of a drive: the law's own deviation from the desired distance while the car moves, as running sums.

The lab report takes the mean over all samples; so does `law_error_m` of `wallride lab report`, standing ones too.
"""

import math
from dataclasses import dataclass
from typing import Final

STANDING_BELOW_MPS: Final = 0.05


@dataclass(slots=True)
class Score:
    """Mean and RMS of the distance error over all scans that saw a wall while the car moved.

    A car that stands repeats one error for as long as it waits, which says nothing of the law.
    """

    count: int = 0
    sum_abs_m: float = 0.0
    sum_square_m2: float = 0.0

    def add(self, error_m: float, speed_mps: float) -> None:
        """Count one scan; NaN (no wall, or an unknown speed) is not counted."""
        if not math.isnan(error_m) and abs(speed_mps) > STANDING_BELOW_MPS:
            self.count += 1
            self.sum_abs_m += abs(error_m)
            self.sum_square_m2 += error_m * error_m

    @property
    def mean_abs_m(self) -> float:
        """Mean absolute error [m], NaN before the first."""
        return self.sum_abs_m / self.count if self.count else math.nan

    @property
    def rms_m(self) -> float:
        """Root of the mean squared error [m], NaN before the first."""
        return math.sqrt(self.sum_square_m2 / self.count) if self.count else math.nan
