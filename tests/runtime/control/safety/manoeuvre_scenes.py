"""A car in an emergency: its start, what is around it, and what the rollouts predict."""

import numpy as np

from tests.runtime.control.safety.swept_scenes import SETTINGS
from tests.runtime.control.scans import CAR
from wallride.runtime.control.safety.emergency_manoeuvre import FULL_BRAKE, EmergencyState, candidates, choose
from wallride.runtime.control.safety.manoeuvre_rollout import RolloutStart, latency_path, roll_out
from wallride.runtime.control.vehicle import GRAVITY_MPS2

GRIPS_MPS2 = 0.8 * GRAVITY_MPS2, 0.5 * GRAVITY_MPS2
NO_PAST = np.zeros(30)
LOCK_RAD = CAR.max_steering_rad


def start(speed_mps=3.0, braked_mps2=0.0, latency_s=0.05, waits_s=0.0):
    return RolloutStart(
        speed_mps, braked_mps2, latency_s, CAR.steering_rate_radps, CAR.wheelbase_m, SETTINGS.cornering_per_rad,
        CAR.front_m, CAR.rear_m, CAR.half_width_m, waits_s,
    )  # fmt: skip


def rolled(steering_rad, brake_mps2, grip_mps2=GRIPS_MPS2[0], past_rad=NO_PAST, **how):
    begun = latency_path(car := start(**how), past_rad.tolist(), [], grip_mps2)
    return list(roll_out(car, begun, steering_rad, brake_mps2, grip_mps2))


def box(ahead_m, width_m, left_m=0.0):
    """Points on the near face of a box, so far ahead of the bumper."""
    return CAR.front_m + ahead_m + 1j * (left_m + np.linspace(-width_m / 2, width_m / 2, 60))


def situation(points_m, past_rad=NO_PAST, **how):
    return EmergencyState(start(**how), points_m, GRIPS_MPS2, past_rad, np.full(5, past_rad[-1]))


def outcomes_for(points_m, wish_rad=0.0, **how):
    return situation(points_m, **how).predict(
        candidates(wish_rad, (-LOCK_RAD, LOCK_RAD), GRIPS_MPS2, SETTINGS.gentle_share)
    )


def chosen_for(points_m, wish_rad=0.0, kept=FULL_BRAKE, **how):
    return choose(outcomes_for(points_m, wish_rad, **how), kept, wish_rad)
