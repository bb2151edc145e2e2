"""What a car knows of where it races: the map, the pose on it, and the line."""

from dataclasses import dataclass

from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.line_field import LineField
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.localization.wall_points import MapGrid


@dataclass(frozen=True, slots=True, eq=False)
class RaceCourse:
    """One map with what finds the pose on it, by its name. line: None where the map has none.

    grid: the map to be shown, None where it is not.
    """

    name: str
    field: LineField
    localizer: Localizer
    line: CourseLine | None = None
    grid: MapGrid | None = None
