"""An emulated hobby ESC with its servo: pulses in, a demand on the motor out. Deliberately not built on the driver.

It is armed by neutral; a pulse on the far side of neutral brakes after driving forward, and drives backward once
neutral was seen after a brake, with the wheels at rest.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.devices.vesc import MotorDemand

WIRING: Final = VescSettings()
"""Gains between metres and the simulated wheels' revolutions."""
COAST: Final = MotorDemand("coast", 0.0)
NEUTRAL_WITHIN_US: Final = 20.0


@dataclass(frozen=True, slots=True)
class EscModel:
    """How this car answers pulses, which its settings may say wrong.

    brake_a: of the farthest brake pulse. shortest_us, longest_us: beyond these the linkage goes no further.
    """

    neutral_us: float = 1500.0
    dead_us: float = 50.0
    us_per_mps: float = 50.0
    brake_a: float = 45.0
    brake_reach_us: float = 300.0
    center_us: float = 1500.0
    us_per_rad: float = -1150.0
    shortest_us: float = 0.0
    longest_us: float = math.inf
    armed_after_s: float = 1.0


BATTERY_SHARE: Final = 0.8
"""Pulse per m/s over that of the settings: a charged battery drives faster than was measured."""


def esc_of(settings: PwmSettings) -> EscModel:
    """Return the ESC of a car whose settings are right but for the battery."""
    return EscModel(
        neutral_us=settings.neutral_us, dead_us=settings.forward_us - settings.neutral_us,
        us_per_mps=settings.throttle_us_per_mps * BATTERY_SHARE, brake_reach_us=settings.neutral_us - settings.brake_us,
        center_us=settings.steering_center_us, us_per_rad=settings.steering_us_per_rad,
    )  # fmt: skip


class EmulatedEsc:
    """The ESC and the servo of a car. pulses: commanded pairs (steering, throttle) so far.

    on_command: called with the time and the new demand.
    """

    def __init__(
        self, model: EscModel = EscModel(), on_command: Callable[[float, MotorDemand], None] = lambda _s, _d: None
    ) -> None:
        self.model, self._on_command = model, on_command
        self.imu: tuple[float, ...] = ()
        self.pulses = 0
        self.wheels_mps = 0.0
        self.steering_rad = 0.0
        self._throttle_us: float | None = None
        self._neutral_s: float | None = None
        self._armed = self._drove_forward = False
        self._may_reverse = True
        self._demand = COAST

    def power_cycle(self) -> None:
        """Lose the supply for a moment: it has to be armed again."""
        self._armed, self._neutral_s, self._throttle_us, self._demand = False, None, None, COAST

    def no_signal(self) -> None:
        """Get no pulses any more: it coasts."""
        self._throttle_us, self._demand = None, COAST

    def pulse(self, steering_us: float, throttle_us: float, now_s: float) -> None:
        """Take both pulses."""
        self.pulses += 1
        at_us = min(max(steering_us, self.model.shortest_us), self.model.longest_us)
        self.steering_rad = (at_us - self.model.center_us) / self.model.us_per_rad
        self._throttle_us = throttle_us
        self._demand = self._obey(throttle_us, now_s)
        self._on_command(now_s, self._demand)

    @property
    def servo(self) -> float:
        """Return the servo position that stands for the commanded angle."""
        return WIRING.steering_to_servo_offset + WIRING.steering_to_servo_gain * self.steering_rad

    def demand(self, _now_s: float) -> MotorDemand:
        """Return the present demand on the motor."""
        return self._demand

    @property
    def speed_mps(self) -> float | None:
        """Return the speed asked for, None for a brake and for none."""
        if self._demand.kind != "speed":
            return None
        return (self._demand.value - WIRING.speed_to_erpm_offset) / WIRING.speed_to_erpm_gain

    def report(self, erpm: float, tachometer: int) -> None:  # noqa: ARG002 - it tells nothing of them
        """Note the wheels' motion, of which such a car has no report."""
        self.wheels_mps = erpm / WIRING.speed_to_erpm_gain

    def _obey(self, throttle_us: float, now_s: float) -> MotorDemand:
        model, off_us = self.model, throttle_us - self.model.neutral_us
        if abs(off_us) < NEUTRAL_WITHIN_US:
            self._neutral_s = now_s if self._neutral_s is None else self._neutral_s
            self._armed = self._armed or now_s - self._neutral_s >= model.armed_after_s
            self._may_reverse = self._may_reverse or (not self._drove_forward and abs(self.wheels_mps) < 0.1)
            return COAST
        self._neutral_s = None
        if not self._armed:
            return COAST
        driven_mps = math.copysign(max(abs(off_us) - model.dead_us, 0.0) / model.us_per_mps, off_us)
        if off_us > 0:
            self._drove_forward, self._may_reverse = True, False
            return MotorDemand("speed", driven_mps * WIRING.speed_to_erpm_gain) if driven_mps else COAST
        if self._may_reverse:
            return MotorDemand("speed", driven_mps * WIRING.speed_to_erpm_gain) if driven_mps else COAST
        self._drove_forward = False
        return MotorDemand("brake", model.brake_a * min(-off_us / model.brake_reach_us, 1.0))
