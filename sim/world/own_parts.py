"""Parts of the car in the lidar's view, as in recordings: posts, mounts, cables and wheels beside and behind the lidar.

The numbers are medians over recordings of six cars (`racecar/` of the shared data; `wide` and `beside` of two more, of
which only a description is available). Parts hide what is behind them; black ones reflect only some of the beams; at
their rims a beam reads a mixture of the part and the background (mixed pixels).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from wallride.sim.world.pose import Booleans, Floats

RIM_BEAMS = 2
"""Number of beams at each end of a part that meet its edge."""
RIM_MIXES = 3
"""Exponent of the random share of the background in a mixed pixel, which is mostly the part."""


@dataclass(frozen=True, slots=True)
class Part:
    """One part: its outline as (bearing in deg, range in m), straight between them.

    answers: share of its beams that return at all. seen_before_m: it is seen only while what lies behind it is nearer
    (a film on the window that lets the beam through to anything farther).
    """

    outline: tuple[tuple[float, float], ...]
    answers: float = 1.0
    seen_before_m: float = float("inf")

    def mirrored(self) -> "Part":
        """Return the same part on the other side of the car."""
        return Part(tuple((-deg, m) for deg, m in reversed(self.outline)), self.answers, self.seen_before_m)


_WIDE = Part(((123.25, 0.58), (126.0, 0.52), (129.0, 0.50), (132.0, 0.52), (134.75, 0.57)))
_BESIDE = Part(((95.0, 0.36), (97.5, 0.31), (100.0, 0.34)))
OWN_PARTS: dict[str, tuple[Part, ...]] = {
    "none": (),
    "posts": (  # t3_crash_1_5mps
        Part(((113.0, 0.57), (114.5, 0.58), (116.0, 0.49), (117.0, 0.37), (118.5, 0.31), (122.5, 0.43)), 0.4),
        Part(((122.75, 0.32), (124.0, 0.27), (125.0, 0.29)), 0.95),
        Part(((125.25, 0.31), (127.0, 0.36)), 0.4),
        Part(((129.0, 0.27), (131.0, 0.24), (132.0, 0.28)), 0.35),
        Part(((133.0, 0.24), (134.0, 0.41), (135.0, 0.46)), 0.35),
        Part(((-126.0, 0.31), (-125.0, 0.42), (-123.75, 0.44)), 0.85),
        Part(((-135.0, 0.10), (-132.0, 0.08), (-128.75, 0.09))),
    ),
    "mounts": (  # t3_brake_1_75mps
        Part(((116.25, 0.48), (117.0, 0.39), (118.5, 0.31), (122.0, 0.42)), 0.58),
        Part(((122.5, 0.30), (124.0, 0.26), (125.0, 0.29)), 0.95),
        Part(((126.0, 0.34), (127.25, 0.37)), 0.58),
        Part(((129.0, 0.30), (131.0, 0.25), (135.0, 0.47)), 0.5),
        Part(((-135.0, 0.10), (-132.0, 0.08), (-129.0, 0.09))),
    ),
    "cables": (  # t3_wall_data
        Part(((115.0, 0.62), (116.0, 0.42), (118.0, 0.35), (121.0, 0.43), (122.5, 0.40)), 0.5),
        Part(((123.0, 0.28), (124.0, 0.23), (125.25, 0.26)), 0.7),
        Part(((126.25, 0.38), (128.0, 0.34), (131.0, 0.25), (132.0, 0.30), (134.0, 0.39)), 0.3),
        Part(((-120.25, 0.24), (-119.0, 0.43), (-113.0, 0.47)), 0.33),
        Part(((-135.0, 0.19), (-132.5, 0.14), (-128.0, 0.23), (-125.5, 0.14)), 0.31),
    ),
    "trail": (  # t1_standing_odom_nav
        Part(((-116.5, 0.79), (-115.5, 0.48), (-114.5, 0.29), (-112.5, 0.10), (-111.5, 0.38), (-110.0, 0.88))),
        Part(((111.25, 0.11), (112.0, 0.12))),
        Part(((125.75, 0.11), (127.5, 0.10)), 0.8),
        Part(((-127.25, 0.07), (-125.0, 0.05), (-123.0, 0.03))),
    ),
    "film": (  # t14_straight_1mps
        Part(((123.25, 0.76), (124.5, 0.65), (128.0, 0.55), (130.5, 0.48), (132.5, 0.47), (135.0, 0.53)), 0.95, 1.7),
        Part(((-134.75, 0.08), (-132.0, 0.07))),
    ),
    "wide": (_WIDE, _WIDE.mirrored()),
    "beside": (_BESIDE, _BESIDE.mirrored(), Part(((-135.0, 0.10), (-129.0, 0.09)))),
}
"""Parts by name, on the side on which the recorded car had them."""
KINDS = tuple(name for name in OWN_PARTS if name != "none")


def kind_of(seed: int) -> str:
    """Return the kind of own parts of a run's seed: none for every other seed, the kinds in turn for those between."""
    return KINDS[seed // 2 % len(KINDS)] if seed % 2 else "none"


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Own parts per beam, (beams,): range, inf without one; share of returns; range limit of visibility; rim."""

    range_m: Floats
    answers: Floats
    before_m: Floats
    rim: Booleans


@lru_cache(maxsize=16)
def profile(kind: str, first_deg: float, last_deg: float, beams: int) -> Profile:
    """Return the profile of the parts in the beams of a lidar."""
    bearing_deg = np.linspace(first_deg, last_deg, beams)
    range_m, answers = np.full(beams, np.inf), np.ones(beams)
    before_m, rim = np.full(beams, np.inf), np.zeros(beams, np.bool_)
    for part in OWN_PARTS[kind]:
        at_deg, at_m = np.array(part.outline).T
        on = np.flatnonzero((bearing_deg >= at_deg[0] - 1e-6) & (bearing_deg <= at_deg[-1] + 1e-6))
        range_m[on] = np.interp(bearing_deg[on], at_deg, at_m)
        answers[on], before_m[on] = part.answers, part.seen_before_m
        rim[on[:RIM_BEAMS]] = rim[on[-RIM_BEAMS:]] = True
    return Profile(range_m, answers, before_m, rim)


def seen_with_parts(
    ranges_m: Floats, parts: Profile, rng: np.random.Generator, range_max_m: float
) -> tuple[Floats, Booleans]:
    """Return the ranges (beams,) seen past the parts from these ranges of a world, and the beams without a return."""
    dice, mixed = rng.random((2, ranges_m.size))
    hides = (parts.range_m < ranges_m) & (ranges_m < parts.before_m)
    share = np.where(parts.rim, mixed**RIM_MIXES, 0.0)
    # inf - inf and 0 * inf are NaN: beams without a part, and open sky behind one.
    part_m = np.where(hides, parts.range_m, 0.0)
    beyond_m = np.minimum(ranges_m, range_max_m)
    seen_m = np.where(hides, part_m + share * (beyond_m - part_m), ranges_m)
    return seen_m, hides & (dice >= parts.answers)
