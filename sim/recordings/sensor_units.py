"""Conversion of recorded metres to the integers that the sensor must have sent, for the emulated lidar."""

import numpy as np
import numpy.typing as npt

NO_RETURN_MM = 65533
"""Value that a UST-10LX sends for a beam without echo; its driver records it as 65.533 m."""
SCIP_MAX_MM = 0o777777
"""Largest distance in SCIP's three-character encoding: 18 bits, 262143."""


def to_sensor_mm(
    ranges_m: npt.NDArray[np.floating], range_min_m: float = 0.0, range_max_m: float = 0.0
) -> npt.NDArray[np.int32]:
    """Return the integers that the sensor must have sent, in millimetres; same shape as given.

    ranges_m: as recorded. Finite values are rounded to the nearest millimetre, whatever the limits say: 65.533
        becomes 65533 again, 0 stays 0 and 0.006 the error code 6.
    range_min_m, range_max_m: the sensor's limits, as recorded. They only choose a code for NaN and infinity,
        such that the receiver must reject it: +inf and NaN become NO_RETURN_MM, or SCIP_MAX_MM for a sensor that
        sees that far; -inf (REP-117: too close) becomes 0, or as NaN where a distance of 0 would be valid.

    Results are clipped to the range of SCIP, 0 to SCIP_MAX_MM.
    """
    no_return_mm = NO_RETURN_MM if range_max_m * 1000 < NO_RETURN_MM else SCIP_MAX_MM
    too_near_mm = 0 if range_min_m > 0 else no_return_mm
    millimetres = np.rint(np.asarray(ranges_m, dtype=np.float64) * 1000)
    known: npt.NDArray[np.float64] = np.nan_to_num(
        millimetres, nan=no_return_mm, posinf=no_return_mm, neginf=too_near_mm
    )
    return np.clip(known, 0, SCIP_MAX_MM).astype(np.int32)
