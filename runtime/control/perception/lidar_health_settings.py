"""Settings of the assessment of the lidar's window, with units and reasons."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class LidarHealthSettings(BaseModel):
    """Thresholds for dirty beams and for the amount of dirt that is still safe."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    memory_m: Annotated[float, Field(gt=0, le=10)] = 0.8
    """Evidence decays over metres moved, not over seconds: a parked car learns nothing."""
    first_mask_m: Annotated[float, Field(ge=0, le=20)] = 1.5
    """So far the car must have driven before the first beam is masked as dirty."""
    mask_above: Annotated[float, Field(gt=0, lt=1)] = 0.6
    """A beam is masked when its evidence of dirt rises above this."""
    unmask_below: Annotated[float, Field(gt=0, lt=1)] = 0.3
    """A masked beam counts again when its evidence of dirt falls below this."""
    masked_share: Annotated[float, Field(ge=0, le=1)] = 0.10
    """Masks are believed while fewer of the beams within +-105 degrees than this are dirty..."""
    masked_gap_rad: Annotated[float, Field(ge=0, le=1)] = 0.0524
    """...and no gap in the forward +-45 degrees is wider than this (3 degrees)."""
    refused_share: Annotated[float, Field(ge=0, le=1)] = 0.25
    """With more dirt than this the car does not drive."""
    empty_share: Annotated[float, Field(gt=0, le=1)] = 0.9
    """Halls leave 6 to 64 % of the beams without an echo; more than this is no hall but a covered lidar."""
