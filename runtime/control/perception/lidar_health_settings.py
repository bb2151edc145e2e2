"""Settings of the assessment of the lidar's window, with units and reasons."""

from typing import Annotated

from pydantic import Field

from wallride.drivers.section import Section


class LidarHealthSettings(Section):
    """Thresholds for dirty beams and for the amount of dirt that is still safe."""

    memory_m: Annotated[float, Field(gt=0, le=10)] = 0.8
    """Way over which evidence of dirt decays; a parked car learns nothing."""
    first_mask_m: Annotated[float, Field(ge=0, le=20)] = 1.5
    """Minimum way before the first beam is masked as dirty."""
    mask_above: Annotated[float, Field(gt=0, lt=1)] = 0.6
    """Evidence of dirt above which a beam is masked."""
    unmask_below: Annotated[float, Field(gt=0, lt=1)] = 0.3
    """Evidence of dirt below which a masked beam is used again."""
    masked_share: Annotated[float, Field(ge=0, le=1)] = 0.10
    """Maximum share of dirty beams within +-105 degrees without a speed limit."""
    masked_gap_rad: Annotated[float, Field(ge=0, le=1)] = 0.0524
    """Maximum dirty gap within +-45 degrees without a speed limit (0.0524 rad = 3 degrees)."""
    refused_share: Annotated[float, Field(ge=0, le=1)] = 0.25
    """Maximum share of dirty beams; with more the car stops."""
    empty_share: Annotated[float, Field(gt=0, le=1)] = 0.9
    """Maximum share of beams without an echo; with more the lidar counts as covered. Halls reach 6 to 64 %."""
