"""What a hobby ESC makes of a throttle pulse: forward, brake, and reverse only after a brake and neutral. Pure.

One channel has both: after a forward pulse, one on the other side of neutral brakes, however long it is held; once
neutral was seen, the next one drives backward. So a brake is sent only while the ESC would brake, and else neutral.
"""

import math
from typing import Final

from wallride.drivers.pwm.settings import PwmSettings

STANDS_MPS: Final = 0.1
HOLD_S: Final = 0.3
"""Time for which a brake is held after the car stands by what is known of it."""
MAX_BRAKE_S: Final = 3.0
RELEASE_S: Final = 0.15
"""Time of neutral before a reverse pulse drives."""
ROLLS_BACK_MPS: Final = 0.3
"""Speed above which a car that rolls backward is not driven forward."""


class Throttle:
    """Follows the ESC. braked_instead: whether the last speed was not driven, because the ESC must stop first."""

    def __init__(self, settings: PwmSettings) -> None:
        self._settings = settings
        self._way = math.copysign(1.0, settings.forward_us - settings.neutral_us)
        self.braked_instead = False
        self.begin(-math.inf)

    def begin(self, now_s: float) -> None:
        """Note that the ESC is being armed: it has seen neutral only."""
        self._brakes = False
        self._stands_since_s: float | None = None
        self._stop_since_s: float | None = None
        self._neutral_since_s = now_s

    def pulse_us(self, wanted_mps: float, speed_mps: float, now_s: float) -> float:
        """Return the pulse for a speed, 0 being a stop. speed_mps: of the car, as far as it is known."""
        self.braked_instead = False
        if wanted_mps > 0 and speed_mps > -ROLLS_BACK_MPS:
            self._brakes, self._stop_since_s, self._stands_since_s = True, None, None
            self._neutral_since_s = math.inf
            return self._driving_us(self._settings.forward_us, wanted_mps * self._way)
        if wanted_mps < 0 and not self._brakes and now_s - self._neutral_since_s >= RELEASE_S:
            return self._driving_us(self._settings.reverse_us, wanted_mps * self._way)
        self.braked_instead = wanted_mps != 0
        return self._stop_us(speed_mps, now_s)

    def last_us(self) -> float:
        """Return the pulse of a stop that nothing follows."""
        return self._settings.brake_us if self._brakes else self._settings.neutral_us

    def _stop_us(self, speed_mps: float, now_s: float) -> float:
        if not self._brakes:
            self._neutral_since_s = min(self._neutral_since_s, now_s)
            return self._settings.neutral_us
        if self._stop_since_s is None:
            self._stop_since_s = now_s
        if speed_mps > STANDS_MPS:
            self._stands_since_s = None
        elif self._stands_since_s is None:
            self._stands_since_s = now_s
        stood = self._stands_since_s is not None and now_s - self._stands_since_s >= HOLD_S
        if stood or now_s - self._stop_since_s >= MAX_BRAKE_S:
            self._brakes, self._neutral_since_s = False, now_s
            return self._settings.neutral_us
        return self._settings.brake_us

    def _driving_us(self, begin_us: float, signed_mps: float) -> float:
        """Return the pulse beyond the one at which the wheels begin to turn."""
        settings = self._settings
        off_us = begin_us + signed_mps * settings.throttle_us_per_mps - settings.neutral_us
        return settings.neutral_us + min(max(off_us, -settings.throttle_reach_us), settings.throttle_reach_us)


def steering_us(settings: PwmSettings, steering_rad: float) -> float:
    """Return the pulse of the servo for an angle, within the linkage's ends."""
    pulse_us = settings.steering_center_us + settings.steering_us_per_rad * steering_rad
    return min(max(pulse_us, settings.steering_min_us), settings.steering_max_us)


def steering_rad(settings: PwmSettings, pulse_us: float) -> float:
    """Return the angle of a pulse of the servo."""
    return (pulse_us - settings.steering_center_us) / settings.steering_us_per_rad
