"""Settings of the map on which the car finds its pose."""

from typing import Literal

from wallride.runtime.settings_base import Section


class PoseMapSettings(Section):
    """The map on which the car finds its pose. Nothing drives by the pose yet."""

    file: str = ""
    """A map's .yaml file beside its image, as `wallride map` writes it; empty: no pose."""

    start: Literal["lap", "anywhere"] = "lap"
    """Where the car is looked for first: where the map's lap began, or all over the map."""
