"""What YDLIDAR models differ in: speed of the line, sample format, range. Source: YDLIDAR SDK and data sheets."""

from collections.abc import Mapping
from typing import Final

from wallride.drivers.value import value


@value()
class Model:
    """One model or family.

    baud: of its line. sample_s: nominal time between two samples. range_m: (least, most). divisor: of a sample, for mm.
    triangulates: the direction of a sample depends on its distance. one_way: it never answers, and sends at power-on.
    intensity: a byte of intensity stands before each sample.
    """

    name: str
    baud: int
    sample_s: float
    range_m: tuple[float, float]
    divisor: int = 4
    triangulates: bool = True
    one_way: bool = False
    intensity: bool = False


MODELS: Final[Mapping[str, Model]] = {
    "x2": Model("X2", 115200, 1 / 3000, (0.12, 8.0), one_way=True),
    "x4": Model("X4", 128000, 1 / 5000, (0.12, 10.0)),
    "x4-pro": Model("X4 Pro", 128000, 1 / 5000, (0.12, 10.0), one_way=True),
    "g4": Model("G4", 230400, 1 / 9000, (0.12, 16.0)),
    "g6": Model("G6", 512000, 1 / 18000, (0.12, 25.0), divisor=2, triangulates=False),
    "tg": Model("TG", 512000, 1 / 20000, (0.05, 30.0), divisor=1, triangulates=False),
}
"""Models by the word for `lidar.model`."""
CODES: Final[Mapping[int, str]] = {6: "x4", 5: "g4", 13: "g6", 100: "tg", 101: "tg", 102: "tg"}
"""Models by the byte in which they tell it."""
