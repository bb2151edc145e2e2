"""Published lap times of courses, with the conditions that came with them. None is ours, and none was checked."""

from dataclasses import dataclass
from typing import Final

GYM: Final = (
    "f1tenth_gym, friction 1.0489, at most 8 m/s, race line and pure pursuit by the true pose"
    " (BDEvan5/f1tenth_benchmarks)"
)


@dataclass(frozen=True, slots=True)
class PublishedLap:
    """A lap time and where it is from."""

    lap_s: float
    conditions: str


PUBLISHED: Final = {
    "levine": PublishedLap(16.0, "a real car: the University of Pennsylvania's full mark (its example team: 23.48 s)"),
    "stata_basement": PublishedLap(
        32.72, "a real car: won MIT's wall-following race of 2018; whether it took this route is not known"
    ),
    "aut": PublishedLap(16.79, GYM),
    "esp": PublishedLap(35.92, GYM),
    "gbr": PublishedLap(31.24, GYM),
    "mco": PublishedLap(28.08, GYM),
}
"""By the name of the map's file."""
