"""Settings of the map on which the car finds its pose."""

from typing import Literal

from wallride.drivers.section import Section


class PoseMapSettings(Section):
    """The map on which the car finds its pose. The follower `line` drives by the pose."""

    file: str = ""
    """A map's .yaml file beside its image, as `wallride map` writes it; empty: no pose."""

    line: str = ""
    """The map's race line, as `wallride line` writes it; empty: MAP.line.csv beside the map, where there is one."""

    start: Literal["lap", "anywhere"] = "lap"
    """Where the car is looked for first: where the map's lap began, or all over the map."""
