"""The report's figure of merit: deviation from the desired distance, as running sums."""

import math
from dataclasses import dataclass


@dataclass(slots=True)
class Score:
    """Mean and RMS of the distance error over all scans that saw a wall."""

    count: int = 0
    sum_abs_m: float = 0.0
    sum_square_m2: float = 0.0

    def add(self, error_m: float) -> None:
        """Count one scan; NaN (no wall) is not counted."""
        if not math.isnan(error_m):
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
