"""Cross-check of the command, the speed and the distance counter of one VESC. Pure; time is an argument.

Two reactions to a disagreement: a reply with an implausible speed is refused, and a contradiction that lasts is a fault
with its remedy. Only the lidar can tell whether the wheels' travel is the car's own
(`control/perception/plausibility.py`).
"""

import math

MAX_SPEED_MPS = 60.0
JUMP_MPS, JUMP_MPS2, JUMP_WITHIN_S = 3.0, 150.0, 0.1
"""Maximum plausible gain of speed: an allowance, a rate, and the longest time that it is applied to. Free wheels gain
about 70 m/s2. After a longer silence no more is accepted than after JUMP_WITHIN_S. A slower speed is always possible:
wheels lock."""
AGAINST_S = 0.3
AGAINST_MPS = 0.1
"""Minimum speed that counts as a direction: a sensorless motor that stands or starts reads less than this either
way."""
MIN_SLOWING_MPS2 = 2.0
"""Minimum deceleration on any floor of a car that rolls and is commanded in the other direction; it needs time."""
WINDOW_S, GAP_S = 0.3, 0.15
MIN_WAY_M = 0.15
WAY_SHARE = 0.5
COUNTED_STEPS = 3
RUNS_BACKWARDS = "runs backwards: swap two phases of the motor"
COUNTS_WRONG = "speed and distance counter disagree: repeat the motor detection, update the VESC's firmware"


class CrossCheck:
    """Checks one VESC over all its connections."""

    def __init__(self, metres_per_step: float) -> None:
        self._metres_per_step = metres_per_step
        self._speed_mps = 0.0
        self._stamp_s = -math.inf
        self._wish_mps = 0.0
        self.forget()

    def forget(self) -> None:
        """Restart the checks that need time: a fault was cleared, or the counter restarted."""
        self._against_s = 0.0
        self._patience_s = self._patience_for_s(self._wish_mps)
        self._wrong_windows = 0
        self._begin_window()

    def asked(self, speed_mps: float) -> None:
        """Note the command as it was sent; 0 for a brake."""
        if self._wish_mps * speed_mps <= 0:  # another direction, or none
            self._against_s = 0.0
            self._patience_s = self._patience_for_s(speed_mps)
        self._wish_mps = speed_mps

    def is_possible(self, speed_mps: float, stamp_s: float) -> bool:
        """Tell whether a car can have this speed after the last accepted one."""
        jump_mps = JUMP_MPS + JUMP_MPS2 * min(max(stamp_s - self._stamp_s, 0.0), JUMP_WITHIN_S)
        return abs(speed_mps) <= min(MAX_SPEED_MPS, abs(self._speed_mps) + jump_mps)

    def judge(self, speed_mps: float, step_m: float, stamp_s: float) -> str:
        """Take in a possible speed and the distance counted since the last one.

        Return the contradiction, "" for none.
        """
        elapsed_s, before_mps = stamp_s - self._stamp_s, self._speed_mps
        self._stamp_s, self._speed_mps = stamp_s, speed_mps
        if not 0.0 <= elapsed_s <= GAP_S:
            self._begin_window()
            return ""
        if self._runs_backwards(speed_mps, elapsed_s):
            return RUNS_BACKWARDS
        self._window_s += elapsed_s
        self._expected_m += (before_mps + speed_mps) / 2 * elapsed_s
        self._counted_m += step_m
        return COUNTS_WRONG if self._window_s >= WINDOW_S and self._counts_wrong() else ""

    def _patience_for_s(self, wish_mps: float) -> float:
        rolls_mps = abs(self._speed_mps) if self._speed_mps * wish_mps < 0 else 0.0
        return AGAINST_S + rolls_mps / MIN_SLOWING_MPS2

    def _runs_backwards(self, speed_mps: float, elapsed_s: float) -> bool:
        along_mps = speed_mps * math.copysign(1.0, self._wish_mps) if self._wish_mps else 0.0
        if along_mps < -AGAINST_MPS:
            self._against_s += elapsed_s
        elif along_mps > AGAINST_MPS:
            self._against_s = 0.0
        return self._against_s >= self._patience_s

    def _counts_wrong(self) -> bool:
        """Compare the two distances of a full window; a single difference may be a report that came late."""
        way_m = max(abs(self._expected_m), abs(self._counted_m))
        apart_m = abs(self._expected_m - self._counted_m)
        wrong = way_m >= MIN_WAY_M and apart_m > WAY_SHARE * way_m + COUNTED_STEPS * self._metres_per_step
        self._wrong_windows = self._wrong_windows + 1 if wrong else 0
        self._begin_window()
        return self._wrong_windows >= 2

    def _begin_window(self) -> None:
        self._window_s = self._expected_m = self._counted_m = 0.0
