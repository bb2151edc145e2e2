"""Which speed to ask an ESC for, so that a car without a tachometer drives the wanted one. Pure.

The pulses for a speed depend on the battery and the floor: the difference between what is wanted and what the scans
show is added, slowly, and bounded. Where the scans show no speed, the car is thought to follow its command, and is
slow.
"""

import math
from typing import Final

from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.pwm.speed import EstimatedSpeed

SURE_MPS: Final = 0.4
"""Maximum standard deviation of a speed that counts as told."""
FRESH_S: Final = 0.5
"""Maximum age of an estimate that counts."""
SEES_AGAIN_S: Final = 0.5
"""Time for which the speed is told again before the car is fast again."""
BLIND_AFTER_S: Final = 0.15
GAIN, GAIN_PER_S = 0.4, 1.0
"""Shares of an error of the speed that are added at once and per second."""
MAX_ERROR_MPS: Final = 0.5
TRIM_SHARE, TRIM_MPS = 0.5, 0.3
"""Maximum of what is added: share of the wanted speed, and more."""
FOLLOWS_S: Final = 0.3
"""Time constant with which a car is thought to follow its command."""
STALLED_S, STALLED_MPS = 2.0, 0.08
RUNS_AWAY_S, RUNS_AWAY_MPS, RUNS_AWAY_SHARE = 0.4, 0.6, 0.4
BACKWARDS_S, BACKWARDS_MPS = 0.4, 0.25
WANTED_BEFORE_S: Final = 1.0
STALLED = "asked to drive, and the scans show no motion (is the ESC on? motor cable? motor.forward_us?)"
RUNS_AWAY = "faster than asked for (motor.throttle_us_per_mps? motor.forward_us?)"
BACKWARDS = "runs backward when asked to drive forward (swap two cables of the motor, or motor.forward_us)"


class SpeedLoop:
    """Keeps the speed. blind: whether nothing tells it. speed_mps: told, or thought. fault: a contradiction, or ""."""

    def __init__(self, settings: PwmSettings) -> None:
        self._settings = settings
        self.speed_mps = 0.0
        self.blind = True
        self.fault = ""
        self.forget(-math.inf)

    def forget(self, now_s: float) -> None:
        """Begin with a car that stands, at a new connection."""
        self.speed_mps, self.blind, self._trim_mps = 0.0, True, 0.0
        self._wanted_mps, self._most_mps, self._most_s = 0.0, 0.0, now_s
        self._at_s = self._learnt_s = self._told_s = self._told_since_s = now_s
        self._since_s = {STALLED: math.inf, RUNS_AWAY: math.inf, BACKWARDS: math.inf}

    def command_mps(self, wanted_mps: float, now_s: float) -> float:
        """Return the speed to ask the ESC for; 0 stays a stop. wanted_mps: within its bounds."""
        self.advance(now_s)
        self._wanted_mps = wanted_mps
        if abs(wanted_mps) >= self._most_mps or now_s - self._most_s > WANTED_BEFORE_S:
            self._most_mps, self._most_s = abs(wanted_mps), now_s
        if wanted_mps <= 0 or self.blind:
            return wanted_mps + (self._trim_mps if wanted_mps > 0 else 0.0)
        error_mps = self._error_mps()
        return max(wanted_mps + GAIN * error_mps + self._trim_mps, 0.1)

    def learn(self, told: EstimatedSpeed, now_s: float) -> None:
        """Take an estimate, in order."""
        step_s = min(max(now_s - self._learnt_s, 0.0), FRESH_S)
        self._learnt_s = now_s
        self.advance(now_s)
        if not (told.spread_mps < SURE_MPS and math.isfinite(told.speed_mps) and now_s - told.stamp_s < FRESH_S):
            return
        if now_s - self._told_s > BLIND_AFTER_S + step_s:
            self._told_since_s = now_s
        self._told_s = now_s
        self.blind = self.blind and now_s - self._told_since_s < SEES_AGAIN_S
        self.speed_mps = told.speed_mps
        self._judge(now_s)
        if not self.blind and self._wanted_mps > 0:
            most_mps = TRIM_SHARE * self._wanted_mps + TRIM_MPS
            trim_mps = self._trim_mps + GAIN_PER_S * step_s * self._error_mps()
            self._trim_mps = min(max(trim_mps, -most_mps), most_mps)

    def advance(self, now_s: float) -> None:
        """Think the car on to a time."""
        step_s = max(now_s - self._at_s, 0.0)
        self._at_s = now_s
        if now_s - self._told_s > BLIND_AFTER_S:
            self.speed_mps += (self._wanted_mps - self.speed_mps) * -math.expm1(-step_s / FOLLOWS_S)
        if now_s - self._told_s > FRESH_S:
            self.blind = True

    def _error_mps(self) -> float:
        return min(max(self._wanted_mps - self.speed_mps, -MAX_ERROR_MPS), MAX_ERROR_MPS)

    def _judge(self, now_s: float) -> None:
        """Find what the command and the scans contradict each other in, once it lasts."""
        wanted_mps, speed_mps = self._wanted_mps, self.speed_mps
        too_fast_mps = self._most_mps * (1 + RUNS_AWAY_SHARE) + RUNS_AWAY_MPS
        found = {
            STALLED: wanted_mps >= self._settings.min_speed_mps and abs(speed_mps) < STALLED_MPS,
            RUNS_AWAY: abs(speed_mps) > too_fast_mps,
            BACKWARDS: wanted_mps > 0 and speed_mps < -BACKWARDS_MPS,
        }
        for words, after_s in ((STALLED, STALLED_S), (RUNS_AWAY, RUNS_AWAY_S), (BACKWARDS, BACKWARDS_S)):
            self._since_s[words] = min(self._since_s[words], now_s) if found[words] else math.inf
            if now_s - self._since_s[words] >= after_s:
                self.fault = self.fault or words
