"""Settings of the swept-footprint safety and of the recovery from a dead end, with units and reasons."""

from typing import Annotated

from pydantic import Field

from wallride.drivers.section import Section


class SweptSettings(Section):
    """Conditions under which the car slows and stops, for every driving source.

    Defaults: from 96 hazard runs x 6 friction pairs and 76 normal runs in the lab; see docs/laws.md.
    """

    grip_mu: Annotated[float, Field(ge=0.2, le=1.5)] = 0.8
    """Friction assumed for stopping; the outcome hardly depends on it (1 of 48 hazard runs for an error of 0.3)."""
    slippery_mu: Annotated[float, Field(ge=0.1, le=1.5)] = 0.5
    """Friction of a slippery floor; a bend that needs more is also checked on the wider arc of this floor."""
    cornering_per_rad: Annotated[float, Field(gt=0.5, le=50)] = 5.5
    """Cornering stiffness of the rear tyres, in multiples of grip times load (f1tenth_gym: 5.456)."""
    actuation_s: Annotated[float, Field(ge=0, le=0.3)] = 0.05
    """Delay from the decision to the first deceleration; the measured age of the scan is added."""
    gentle_share: Annotated[float, Field(gt=0, lt=1)] = 0.25
    """Gentlest brake of an emergency manoeuvre, as a share of `slippery_mu`; 0.25 leaves 97 % of the grip to turn."""
    hard_share: Annotated[float, Field(gt=0, le=1)] = 0.8
    """Share of the grip assumed for a hard stop."""
    graded_share: Annotated[float, Field(gt=0, le=1)] = 0.45
    """Share of the grip used to slow down before an obstacle."""
    side_margin_m: Annotated[float, Field(ge=0, le=0.3)] = 0.04
    """Margin on each side of the swept outline."""
    wary_margin_m: Annotated[float, Field(ge=0, le=0.3)] = 0.04
    """Additional side margin while an obstacle limits a car above `doubtful_mps`: hysteresis against noise at edges."""
    front_margin_m: Annotated[float, Field(ge=0, le=0.3)] = 0.03
    """Distance between the front of the stopped car and an obstacle."""
    hold_s: Annotated[float, Field(ge=0, le=2)] = 0.2
    """Minimum duration of a hard stop; prevents stop-and-go."""
    release_m: Annotated[float, Field(ge=0, le=2)] = 0.2
    """Free way beyond the stopping distance that ends a hard stop of a moving car."""
    creep_mps: Annotated[float, Field(ge=0, le=1)] = 0.3
    """Minimum speed limit where there is room to move at all."""
    slowest_mps: Annotated[float, Field(ge=0, le=1)] = 0.25
    """Lowest speed limit; the motor coasts below it (VESC: 900 erpm = 0.195 m/s), so the car would never move on."""
    reverse_mps: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Maximum speed backward."""
    reverse_unseen_m: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Maximum way backward into space that the lidar does not see; forward driving restores it."""
    doubtful_mps: Annotated[float, Field(ge=0, le=5)] = 1.0
    """Speed limit with a late scan, a dirty window, or a region without returns in the way."""
    late_s: Annotated[float, Field(gt=0, le=1)] = 0.10
    """Age of a late scan: the speed is limited to `doubtful_mps`."""
    stale_s: Annotated[float, Field(gt=0, le=2)] = 0.25
    """Maximum age of a scan; with an older one the car stops."""


class RecoverySettings(Section):
    """Recovery of a car that is boxed in."""

    boxed_for_s: Annotated[float, Field(ge=0, le=60)] = 2.0
    """Time to wait before backing out: a person in the way usually walks on."""
    tries: Annotated[int, Field(ge=0, le=10)] = 6
    """Maximum number of attempts at one place; then the car asks for help."""
    speed_mps: Annotated[float, Field(gt=0.25, le=0.5)] = 0.4
    """Speed during recovery."""
    back_m: Annotated[float, Field(gt=0.05, le=0.5)] = 0.45
    """Maximum way backward per attempt; `safety.reverse_unseen_m` limits it as well."""
    forward_m: Annotated[float, Field(ge=0, le=5)] = 3.0
    """Maximum way forward at the end of an attempt, before the follower drives on."""
    forgotten_after_m: Annotated[float, Field(gt=0, le=20)] = 2.0
    """Way after which the attempts are counted from 0 again."""
