"""Dynamics of the car: single-track model with saturating tyres that share their grip between braking and turning.

State: the pose of the rear axle, the velocity (u, w) of the centre of gravity in the car's frame, the yaw rate, the
servo's angle and the one speed of all wheels (four-wheel drive, joined). Per axle, with load N and grip mu:

    slip angle   a = atan2(lateral, |longitudinal|) of the contact point, in the wheel's frame
    lateral      F = -sqrt((mu N)^2 - Fx^2) sat(C a)             wheels rolling; sat(z) = z / (1 + z^4)^(1/4)
    both         (Fx, Fy) = -mu N (slip velocity) / |slip velocity|   wheels locking or locked

Below 0.4 m/s the motion is that of a rolling bicycle (curvature tan(steering) / wheelbase), which is exact there and
has no stiff equations; between 0.4 and 0.8 m/s the two are mixed. Accelerating and braking move load between the axles;
driving and braking force is shared like the load. Plain floats: numpy would be ten times slower for so few numbers.
"""

from collections import deque
from math import atan2, ceil, copysign, cos, hypot, remainder, sin, sqrt, tan, tau
from typing import Generic, TypeVar

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.car.motor_control import COAST, BrakeDemand, CoastDemand, Demand, MotorControl, SpeedDemand
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.world.pose import Pose, Twist

T = TypeVar("T")

_ROUNDING_S = 1e-9
__all__ = ["BrakeDemand", "CoastDemand", "Demand", "SpeedDemand", "Vehicle", "VehicleSettings"]

_MAX_STEP_S = 0.0025
_ROLLS_BELOW_MPS = 0.4
_SLIPS_ABOVE_MPS = 0.8
_DRIVE_SHARE = 0.85
"""Share of the grip that the speed control can use longitudinally: all four wheels pull and none slips."""
_SLIP_SCALE_MPS = 0.02
"""Slip speed below which sliding friction fades, so that it does not change its sign from step to step."""


class DelayLine(Generic[T]):
    """Returns each value `delay_s` after it was put in; before the first one is due, the value at rest."""

    def __init__(self, delay_s: float, at_rest: T) -> None:
        self.delay_s = delay_s
        self._now = at_rest
        self._last = at_rest
        self._coming: deque[tuple[float, T]] = deque()

    def put(self, now_s: float, value: T) -> None:
        """Put in a value; times must not run backwards."""
        if value != self._last:
            self._coming.append((now_s + self.delay_s, value))
            self._last = value

    def at(self, now_s: float) -> T:
        """Return the value in effect."""
        while self._coming and self._coming[0][0] <= now_s + _ROUNDING_S:
            self._now = self._coming.popleft()[1]
        return self._now


class Vehicle:
    """A moving car. Deterministic: same settings and same calls give the same motion, bit by bit."""

    def __init__(self, settings: VehicleSettings | None = None, pose: Pose | None = None) -> None:
        self._take(settings or VehicleSettings())
        self.place(pose or Pose(0.0, 0.0, 0.0))

    def change(self, settings: VehicleSettings) -> None:
        """Replace the car's or the floor's settings from here on; commands in transit keep their old delay."""
        self._take(settings)
        self._demands.delay_s, self._steering.delay_s = settings.drive_delay_s, settings.steering_delay_s

    def _take(self, s: VehicleSettings) -> None:
        self.settings = s
        self._motor = MotorControl(s)
        self._rear_m, self._front_m = s.rear_axle_to_cg_m, s.front_axle_to_cg_m
        self._grip_mps2 = s.grip_mu * GRAVITY_MPS2
        self._front_share = self._rear_m / s.wheelbase_m  # of the load, at rest
        self._shift_per_mps2 = s.cg_height_m / (GRAVITY_MPS2 * s.wheelbase_m)
        self._yaw_per_moment = s.mass_kg / s.yaw_inertia_kgm2  # forces are kept per mass, in m/s2
        self._wheel_inertia = s.wheel_mass_kg / s.mass_kg
        # Read 400 times a second and more: access to a model's fields is slower than to plain attributes.
        self._wheelbase_m, self._trim_rad = s.wheelbase_m, s.trim_rad
        self._steering_rate_radps, self._max_steering_rad = s.steering_rate_radps, s.max_steering_rad
        self._stiff_front, self._stiff_rear = s.cornering_front_per_rad, s.cornering_rear_per_rad

    def place(self, pose: Pose, *, speed_mps: float = 0.0) -> None:
        """Place the car at a pose, rolling straight ahead at a speed; drops all commands in transit."""
        self.now_s = 0.0
        self.x_m, self.y_m, self.yaw_rad = pose.x_m, pose.y_m, pose.yaw_rad
        self._forward_mps, self._left_mps, self.yaw_rate_radps = speed_mps, 0.0, 0.0
        self.wheel_speed_mps = speed_mps
        self.wheel_travel_m = 0.0
        self.servo_rad = 0.0
        self._sliding = False
        self._motor.reset()
        self._told: Demand = COAST
        self._demands: DelayLine[Demand] = DelayLine(self.settings.drive_delay_s, COAST)
        self._steering: DelayLine[float] = DelayLine(self.settings.steering_delay_s, 0.0)

    def halt(self) -> None:
        """Stop at once, as against a wall; commands in transit stay in transit."""
        self._forward_mps = self._left_mps = self.yaw_rate_radps = self.wheel_speed_mps = 0.0
        self._sliding = False
        self._motor.reset()

    @property
    def pose(self) -> Pose:
        """Return the pose of the rear axle in the world."""
        return Pose(self.x_m, self.y_m, self.yaw_rad)

    @property
    def twist(self) -> Twist:
        """Return the true velocity of the rear axle in the car's frame."""
        lateral_mps = self._left_mps - self._rear_m * self.yaw_rate_radps
        return Twist(self._forward_mps, self.yaw_rate_radps, lateral_mps)

    @property
    def speed_mps(self) -> float:
        """Return the true forward speed, negative in reverse. The motor reports `wheel_speed_mps`."""
        return self._forward_mps

    @property
    def motor_current_a(self) -> float:
        """Return the motor current of the present driving (same sign as forward) or braking force."""
        return self._motor.motor_mps2 / self.settings.brake_mps2_per_a

    def step(self, dt_s: float, demand: Demand, steering_command_rad: float) -> None:
        """Advance by dt_s with these commands on the wire from the step's beginning.

        They take effect after the delays in the settings. Steps over 2.5 ms are divided.
        """
        if demand is not self._told:
            self._told = demand
            self._demands.put(self.now_s, demand)
        self._steering.put(self.now_s, steering_command_rad)
        parts = max(1, ceil(dt_s / _MAX_STEP_S - 1e-9))
        for _ in range(parts):
            self._advance(dt_s / parts)

    def _advance(self, dt_s: float) -> None:
        wanted_rad = self._steering.at(self.now_s)
        if wanted_rad != self.servo_rad:
            wanted_rad = _within(wanted_rad, self._max_steering_rad)
            self.servo_rad += _within(wanted_rad - self.servo_rad, self._steering_rate_radps * dt_s)
        drive_mps2, brake_mps2 = self._motor.forces(self._demands.at(self.now_s), self.wheel_speed_mps, dt_s)
        self.now_s += dt_s
        if not drive_mps2 and not (self._forward_mps or self._left_mps or self.yaw_rate_radps):
            self.wheel_speed_mps = 0.0
            return
        yaw_before = self.yaw_rate_radps
        angle_rad = self.servo_rad + self._trim_rad
        if self._sliding:
            self._slide(dt_s, drive_mps2, brake_mps2, angle_rad)
        else:
            self._roll(dt_s, drive_mps2, brake_mps2, angle_rad)
        self._move(dt_s, (yaw_before + self.yaw_rate_radps) / 2)

    def _move(self, dt_s: float, yaw_rate_radps: float) -> None:
        middle_rad = self.yaw_rad + yaw_rate_radps * dt_s / 2
        cosine, sine = cos(middle_rad), sin(middle_rad)
        left_mps = self._left_mps - self._rear_m * yaw_rate_radps
        self.x_m += (self._forward_mps * cosine - left_mps * sine) * dt_s
        self.y_m += (self._forward_mps * sine + left_mps * cosine) * dt_s
        self.yaw_rad = remainder(self.yaw_rad + yaw_rate_radps * dt_s, tau)
        self.wheel_travel_m += self.wheel_speed_mps * dt_s

    def _roll(self, dt_s: float, drive_mps2: float, brake_mps2: float, angle_rad: float) -> None:
        """Advance with rolling wheels: longitudinal force from the motor, lateral force from the remaining grip."""
        u, grip_mps2 = self._forward_mps, self._grip_mps2
        # A standing car is held by its drag, which never exceeds the force it opposes.
        drag_mps2 = brake_mps2 if u else min(brake_mps2, abs(drive_mps2))
        along_mps2 = drive_mps2 - copysign(drag_mps2, u or drive_mps2)
        if brake_mps2 > grip_mps2 and abs(along_mps2) > grip_mps2:
            self._sliding = True
            self.wheel_speed_mps = u - copysign(min(_SLIP_SCALE_MPS, abs(u)), u)  # slip at which friction acts in full
            self._slide(dt_s, drive_mps2, brake_mps2, angle_rad)
            return
        if drive_mps2:  # the speed control does not spin the wheels, and leaves grip for steering
            most_mps2 = _DRIVE_SHARE * grip_mps2
            along_mps2 = _within(along_mps2, most_mps2)
        slips = (hypot(u, self._left_mps) - _ROLLS_BELOW_MPS) / (_SLIPS_ABOVE_MPS - _ROLLS_BELOW_MPS)
        if slips < 0.0:
            slips = 0.0
        elif slips > 1.0:
            slips = 1.0
        by_tyres = self._tyre_accelerations(along_mps2, angle_rad) if slips else (along_mps2, 0.0, 0.0)
        new_u = u + (slips * by_tyres[0] + (1.0 - slips) * along_mps2) * dt_s
        if new_u * u < 0.0 and abs(drive_mps2) <= brake_mps2:
            new_u = 0.0  # friction stops the car and does not reverse it
        rolling_rate = new_u * tan(angle_rad) / self._wheelbase_m
        rolling_left = self._rear_m * rolling_rate
        slipping_left = self._left_mps + by_tyres[1] * dt_s
        slipping_rate = self.yaw_rate_radps + by_tyres[2] * dt_s
        self._left_mps = rolling_left + slips * (slipping_left - rolling_left)
        self.yaw_rate_radps = rolling_rate + slips * (slipping_rate - rolling_rate)
        self._forward_mps = self.wheel_speed_mps = new_u

    def _tyre_accelerations(self, along_mps2: float, angle_rad: float) -> tuple[float, float, float]:
        """Return the rates of change of forward and lateral velocity and of the yaw rate while the wheels roll.

        along_mps2: driving (positive) or braking force of all wheels per mass of the car, within the grip.
        """
        u, w, rate = self._forward_mps, self._left_mps, self.yaw_rate_radps
        aside_mps2 = sqrt(max(0.0, self._grip_mps2**2 - along_mps2**2))
        cosine, sine = cos(angle_rad), sin(angle_rad)
        front_left = w + self._front_m * rate
        slip_front = atan2(front_left * cosine - u * sine, abs(u * cosine + front_left * sine))
        slip_rear = atan2(w - self._rear_m * rate, abs(u))
        front_share = self._front_share - self._shift_per_mps2 * along_mps2
        if not 0.0 <= front_share <= 1.0:
            front_share = min(max(front_share, 0.0), 1.0)
        rear_share = 1.0 - front_share
        z_front, z_rear = self._stiff_front * slip_front, self._stiff_rear * slip_rear
        # z / (1 + z^4)^(1/4): linear in the slip at first, saturating at the grip
        front = -front_share * aside_mps2 * (z_front / sqrt(sqrt(1.0 + (z_front * z_front) ** 2)))
        rear = -rear_share * aside_mps2 * (z_rear / sqrt(sqrt(1.0 + (z_rear * z_rear) ** 2)))
        pull = front_share * along_mps2
        front_along, front_aside = pull * cosine - front * sine, pull * sine + front * cosine
        forward = front_along + rear_share * along_mps2 + w * rate
        turning = self._yaw_per_moment * (self._front_m * front_aside - self._rear_m * rear)
        return forward, front_aside + rear - u * rate, turning

    def _slide(self, dt_s: float, drive_mps2: float, brake_mps2: float, angle_rad: float) -> None:
        """Advance with longitudinally slipping wheels: all grip acts against the sliding direction of the tread."""
        u, w, rate, wheel = self._forward_mps, self._left_mps, self.yaw_rate_radps, self.wheel_speed_mps
        grip_mps2 = self._grip_mps2
        if wheel == 0.0 and hypot(u, w) + abs(rate) * self._rear_m <= grip_mps2 * dt_s:
            self.halt()
            return
        cosine, sine = cos(angle_rad), sin(angle_rad)
        front_left = w + self._front_m * rate
        front_x, front_y = _friction(u * cosine + front_left * sine - wheel, front_left * cosine - u * sine)
        rear_x, rear_y = _friction(u - wheel, w - self._rear_m * rate)
        shift = self._shift_per_mps2 * grip_mps2 * rear_x  # the load follows the force, here the whole grip
        front_share = min(max(self._front_share - shift, 0.0), 1.0)
        front_grip, rear_grip = front_share * grip_mps2, (1.0 - front_share) * grip_mps2
        front_along, front_aside = front_x * cosine - front_y * sine, front_x * sine + front_y * cosine
        self._forward_mps = u + (front_grip * front_along + rear_grip * rear_x + w * rate) * dt_s
        self._left_mps = w + (front_grip * front_aside + rear_grip * rear_y - u * rate) * dt_s
        turning = self._front_m * front_grip * front_aside - self._rear_m * rear_grip * rear_y
        self.yaw_rate_radps = rate + self._yaw_per_moment * turning * dt_s
        # The motor's accelerations are those of the rolling car; that includes turning the wheels' own inertia.
        torque = 1.0 + self._wheel_inertia
        floor_mps2 = front_grip * front_x + rear_grip * rear_x
        self._turn_wheels(dt_s, torque * drive_mps2 - floor_mps2, torque * brake_mps2, u)

    def _turn_wheels(self, dt_s: float, turning_mps2: float, brake_mps2: float, before_mps: float) -> None:
        """Accelerate the wheels by torque, slow them by the brake; rolling begins again where slip changes sign."""
        wheel = self.wheel_speed_mps
        if wheel == 0.0 and abs(turning_mps2) <= brake_mps2:
            return
        brakes = copysign(brake_mps2, wheel or turning_mps2)
        turned = wheel + (turning_mps2 - brakes) / self._wheel_inertia * dt_s
        self.wheel_speed_mps = 0.0 if turned * wheel < 0.0 else turned
        if (self.wheel_speed_mps - self._forward_mps) * (wheel - before_mps) <= 0.0 and wheel != before_mps:
            self.wheel_speed_mps = self._forward_mps
            self._sliding = False


def _within(value: float, most: float) -> float:
    """Limit to +-most. Comparisons: min and max take twice as long."""
    if value > most:
        return most
    if value < -most:
        return -most
    return value


def _friction(slip_x_mps: float, slip_y_mps: float) -> tuple[float, float]:
    """Return the direction of sliding friction, as shares of the grip; fades at low slip."""
    size = max(hypot(slip_x_mps, slip_y_mps), _SLIP_SCALE_MPS)
    return -slip_x_mps / size, -slip_y_mps / size
