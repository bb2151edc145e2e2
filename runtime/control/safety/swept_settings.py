"""Settings of the swept-footprint safety and of the recovery from a dead end, with units and reasons."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class SweptSettings(BaseModel):
    """Conditions under which the car slows and stops, for every driving source.

    Defaults: from 96 hazard runs x 6 friction pairs and 76 normal runs in the lab; see docs/laws.md.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    grip_mu: Annotated[float, Field(ge=0.2, le=1.5)] = 0.8
    """Friction assumed. The graded limit makes the outcome nearly independent of it (1 of 48 when wrong by 0.3)."""
    slippery_mu: Annotated[float, Field(ge=0.1, le=1.5)] = 0.5
    """A wish for a bend that only a better floor than this can give is judged on this floor's wider arc as well."""
    cornering_per_rad: Annotated[float, Field(gt=0.5, le=50)] = 5.5
    """Lateral force per slip angle of the rear tyres, in multiples of grip times load (f1tenth_gym: 5.456)."""
    actuation_s: Annotated[float, Field(ge=0, le=0.3)] = 0.05
    """From the decision to the first deceleration; the measured age of the scan is added to it."""
    gentle_share: Annotated[float, Field(gt=0, lt=1)] = 0.25
    """The gentlest brake of an emergency manoeuvre, as a share of a slippery floor's grip; 0.25 leaves 97 % to turn."""
    hard_share: Annotated[float, Field(gt=0, le=1)] = 0.8
    """Share of the grip that a hard stop is reckoned with."""
    graded_share: Annotated[float, Field(gt=0, le=1)] = 0.45
    """Share of the grip that the graded limit lets the car brake with."""
    side_margin_m: Annotated[float, Field(ge=0, le=0.3)] = 0.04
    """Room that is kept free on each side of the swept outline."""
    wary_margin_m: Annotated[float, Field(ge=0, le=0.3)] = 0.04
    """Added aside while something limits a car above `doubtful_mps`, so that noise at an edge does not let it go."""
    front_margin_m: Annotated[float, Field(ge=0, le=0.3)] = 0.03
    """Room that is left between the front of the car and an obstacle when it stands."""
    hold_s: Annotated[float, Field(ge=0, le=2)] = 0.2
    """A hard stop lasts at least so long: no stop-and-go."""
    release_m: Annotated[float, Field(ge=0, le=2)] = 0.2
    """A hard stop of a moving car ends when the way is so much longer than the stopping distance."""
    creep_mps: Annotated[float, Field(ge=0, le=1)] = 0.3
    """The speed that is still allowed where there is room for nothing faster."""
    slowest_mps: Annotated[float, Field(ge=0, le=1)] = 0.25
    """Below this the motor coasts (VESC: 900 erpm = 0.195 m/s): a lower limit would be a stop for ever."""
    reverse_mps: Annotated[float, Field(ge=0, le=2)] = 0.5
    """The fastest that the car may drive backward."""
    reverse_unseen_m: Annotated[float, Field(ge=0, le=2)] = 0.5
    """How far the car may back into what the lidar does not see, before it has to come forward again."""
    doubtful_mps: Annotated[float, Field(ge=0, le=5)] = 1.0
    """Ceiling with a late scan, a doubtful window, or an enclosed dark patch in the way."""
    late_s: Annotated[float, Field(gt=0, le=1)] = 0.10
    """A scan older than this is late: the car goes on at doubtful_mps at most."""
    stale_s: Annotated[float, Field(gt=0, le=2)] = 0.25
    """A scan older than this counts as no scan: the car stops."""


class RecoverySettings(BaseModel):
    """Recovery of a car that is boxed in."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    boxed_for_s: Annotated[float, Field(ge=0, le=60)] = 2.0
    """Patience: a person in the way walks on by himself."""
    tries: Annotated[int, Field(ge=0, le=10)] = 6
    """Ways out begun at one place before the car asks for help."""
    speed_mps: Annotated[float, Field(gt=0.25, le=0.5)] = 0.4
    """The speed while the car frees itself."""
    back_m: Annotated[float, Field(gt=0.05, le=0.5)] = 0.45
    """Farthest back from where the car last came forward; safety's `reverse_unseen_m` holds as well."""
    forward_m: Annotated[float, Field(ge=0, le=5)] = 3.0
    """Longest last piece forward before the driver gets the wheel back."""
    forgotten_after_m: Annotated[float, Field(gt=0, le=20)] = 2.0
    """So far on, the tries are counted anew."""
