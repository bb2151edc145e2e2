"""The path that a source promises to drive: what safety judges in place of the arc of the present steering."""

import numpy as np
import numpy.typing as npt

from wallride.drivers.value import value


@value(eq=False)
class Promise:
    """A path from where the car is at the scan's stamp, in base_link: the way that the commands to come will lead.

    path_m: (2, n) places of the rear axle, the first one at the origin. speed_mps: (n,), at most, at each of them.
    margin_m: how far beside its promises the source has driven so far. stamp_s: of the scan.
    """

    path_m: npt.NDArray[np.float64]
    speed_mps: npt.NDArray[np.float64]
    margin_m: float
    stamp_s: float
