"""The speed of a car without a tachometer, as something else estimates it."""

from wallride.drivers.value import value


@value()
class EstimatedSpeed:
    """An estimate. spread_mps: its standard deviation; infinity: nothing tells it."""

    stamp_s: float
    speed_mps: float
    spread_mps: float
