"""Obstacles in one line of text, for options, settings files and pages.

box at=3,1                      a box of 0.3 x 0.5 m that stands at x, y [m] from the beginning
box at=3,1,0.7 size=0.2x0.8     turned by 0.7 rad, 0.2 m long and 0.8 m wide
box ahead=1.5 after=4           appears 4 s into the drive, its near face 1.5 m before the lidar
box ahead=1 left=0.2 speed=2    appears when the car does 2 m/s, 0.2 m left of its middle
pole at=3,1 radius=0.02
person at=3,-1 walks=0,0.8 after=2 until=5     walks with these velocities in the world [m/s]
"""

import math
import re
from collections.abc import Mapping

from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, Round, StandingObstacle, SuddenObstacle
from wallride.sim.world.pose import Pose

KINDS = ("box", "pole", "person")
KEYS = ("at", "ahead", "left", "after", "until", "speed", "size", "radius", "walks")
EXAMPLE = 'for example "box ahead=1.5 after=4" or "person at=3,-1 walks=0,0.8"'
BOX_M = (0.3, 0.5)
RADIUS_M = {"pole": 0.02, "person": 0.2}
_NUMBER = r"-?\d+(?:\.\d+)?"


def read_obstacle(text: str) -> Obstacle:
    """Return the obstacle that a line describes; ValueError with the remedy for an invalid line."""
    kind, *parts = text.split() or [""]
    words = dict(part.partition("=")[::2] for part in parts)
    if kind not in KINDS:
        raise ValueError(f"obstacle {text!r}: begins with {', '.join(KINDS)}; {EXAMPLE}")
    if unknown := [name for name in words if name not in KEYS]:
        raise ValueError(f"obstacle {text!r}: {unknown[0]} is unknown; there are {', '.join(KEYS)}; {EXAMPLE}")
    if ("at" in words) == ("ahead" in words):
        raise ValueError(f"obstacle {text!r}: say where it is, with at=X,Y or with ahead=M; {EXAMPLE}")
    shape = _shape(kind, words, text)
    from_s = _numbers(words, "after", text, (1,), (-math.inf,))[0]
    return Obstacle(shape, _appearance(words, text, from_s), _motion(words, text, from_s))


def _shape(kind: str, words: Mapping[str, str], text: str) -> Round | Box:
    if kind == "box":
        size_m = _numbers({"size": words.get("size", "").replace("x", ",")}, "size", text, (2,), BOX_M)
        if min(size_m) <= 0:
            raise ValueError(f"obstacle {text!r}: size={words['size']} has no area")
        return Box(*size_m)
    radius_m = _numbers(words, "radius", text, (1,), (RADIUS_M[kind],))[0]
    if radius_m <= 0:
        raise ValueError(f"obstacle {text!r}: radius={words['radius']} must be above 0")
    return Round(radius_m)


def _appearance(words: Mapping[str, str], text: str, from_s: float) -> StandingObstacle | SuddenObstacle:
    if "at" in words:
        x_m, y_m, *turned = _numbers(words, "at", text, (2, 3), ())
        return StandingObstacle(Pose(x_m, y_m, turned[0] if turned else 0.0), from_s)
    ahead_m = _numbers(words, "ahead", text, (1,), ())[0]
    left_m = _numbers(words, "left", text, (1,), (0.0,))[0]
    return SuddenObstacle(ahead_m, left_m, _numbers(words, "speed", text, (1,), (0.0,))[0], from_s)


def _motion(words: Mapping[str, str], text: str, from_s: float) -> ConstantMotion | None:
    if "walks" not in words:
        return None
    x_mps, y_mps = _numbers(words, "walks", text, (2,), ())
    return ConstantMotion(x_mps, y_mps, from_s, _numbers(words, "until", text, (1,), (math.inf,))[0])


def _numbers(
    words: Mapping[str, str], name: str, text: str, counts: tuple[int, ...], default: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the numbers behind a key, separated by commas."""
    given = words.get(name, "")
    if not given and default:
        return default
    numbers = given.split(",")
    if len(numbers) not in counts or not all(re.fullmatch(_NUMBER, number) for number in numbers):
        wanted = " or ".join(str(count) for count in counts)
        raise ValueError(f"obstacle {text!r}: {name}={given} is not {wanted} number{'s' if counts != (1,) else ''}")
    return tuple(map(float, numbers))
