"""Ways of a car by servo pulses: where its ESC begins to drive, how fast it is by which pulse, how far it steers.

Such a car has no tachometer: way and speed in `seen.motor` are what its scans show.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

from wallride.clients.calibration.ways import (
    CalibratedCar,
    CalibrationError,
    check_room,
    distance_m,
    drive_there_and_back,
    stand,
)
from wallride.runtime.calibration import proposals
from wallride.runtime.calibration.throttle_fit import PulseSpeed, fit_throttle, steady_mps

NEUTRALS_OFF_US = (0, 20, -20, 40, -40, 60, -60, 80, -80, 100, -100)
"""Distances from the configured neutral at which an ESC is looked for that is not armed by it."""
DEAD_US = (50, 30, 70)
"""Distances of neutral from the pulse that drives, where the neutral that it was found from is none."""
ARMS_S = 1.5
SWEEP_US = range(20, 161, 10)
"""Distances from neutral that are tried one after the other until the car moves."""
DWELL_S, RELEASE_S, STANDS_WITHIN_S = 0.35, 0.4, 4.0
MOVED_M = 0.04
FIRST_BRAKE_US, GENTLE_US = 25.0, 60.0
"""Distances of a brake pulse beyond the one that drives backward: of the first one, which shows whether the ESC brakes
by it or drives backward, and of the later ones."""
BACK_M = 0.12
SWEEP_M, WAY_M = 0.6, 1.2
SLOWEST_S = 8.0
SPEEDS_MPS, BACK_MPS = (0.3, 0.6, 0.9, 1.1, 0.45, 0.75, 1.0), 0.35
LOCK_M = 0.5
NO_MOTION = (
    "no pulse from {:.0f} to {:.0f} us moved the car, whichever neutral its ESC was given: is the ESC on, its battery"
    " charged, motor.throttle_channel right, and the car on the floor with its way free?"
)
MOVES = "the car moves at {:.0f} us, which is to be its neutral: see motor.neutral_us, or teach the ESC its neutral"
BACKWARD = (
    "by the scans the car drove backward by a pulse that is to drive forward: swap two cables of its motor, or exchange"
    " motor.forward_us and motor.reverse_us; did you see it drive forward? then the lidar is turned by 180 degrees, see"
    " lidar.yaw_rad"
)
NO_BRAKE = "the car drove backward by its brake pulse: set the ESC to forward, brake and reverse"
NO_REVERSE = "no pulse down to {:.0f} us drove the car backward: set the ESC to forward, brake and reverse"


class PulsedCar(CalibratedCar, Protocol):
    """A car whose pulses are chosen. throttle_us: the last one."""

    throttle_us: float

    def use(self, now: Mapping[str, float], *, gentle: bool) -> None:
        """Drive by these settings from here on. gentle: brake no harder than the ESC needs to notice it."""

    def pulse(self, throttle_us: float) -> None:
        """Give the ESC a pulse [us] until the next call; CalibrationError as of `send`."""


def find_range(car: PulsedCar, now: Mapping[str, float]) -> dict[str, float]:
    """Return where the car begins to drive forward and backward, and the neutral between, each to about 20 us."""
    check_room(car, SWEEP_M)
    way = math.copysign(1.0, now[proposals.FORWARD] - now[proposals.NEUTRAL])
    for off_us in NEUTRALS_OFF_US:
        neutral_us = now[proposals.NEUTRAL] + off_us
        _keep(car, neutral_us, ARMS_S)
        if (forward_us := _sweep(car, neutral_us, way, 1.0)) is not None:
            break
    else:
        low, high = now[proposals.NEUTRAL] - 100, now[proposals.NEUTRAL] + 100
        raise CalibrationError(NO_MOTION.format(*sorted((low, high + way * SWEEP_US[-1]))))
    _brake(car, neutral_us - (forward_us - neutral_us) - way * FIRST_BRAKE_US)
    reverse_us = _find_reverse(car, (neutral_us, *(forward_us - way * dead_us for dead_us in DEAD_US)), way)
    return {
        proposals.NEUTRAL: (forward_us + reverse_us) / 2,
        proposals.FORWARD: forward_us - way * SWEEP_US.step, proposals.REVERSE: reverse_us + way * SWEEP_US.step,
    }  # fmt: skip


def _find_reverse(car: PulsedCar, neutrals_us: Sequence[float], way: float) -> float:
    """Return the pulse at which the car begins to drive backward, by the first neutral that its ESC takes for one.

    Each is tried twice: an ESC may take the first pulses on that side for a brake.
    """
    for neutral_us in (*neutrals_us, *neutrals_us):
        _rest(car, neutral_us)
        _keep(car, neutral_us, RELEASE_S)
        if (reverse_us := _sweep(car, neutral_us, -way, -1.0)) is not None:
            _rest(car, neutral_us)
            return reverse_us
    raise CalibrationError(NO_REVERSE.format(neutrals_us[0] - way * SWEEP_US[-1]))


def drive_speeds(car: PulsedCar, now: Mapping[str, float]) -> list[PulseSpeed]:
    """Drive to and fro at several pulses; each pulse is chosen by what the ways before told."""
    way = math.copysign(1.0, now[proposals.FORWARD] - now[proposals.NEUTRAL])
    found: list[PulseSpeed] = []
    start_m = distance_m(car)
    for speed_mps in SPEEDS_MPS:
        car.use(now, gentle=True)
        stand(car, 0.0, 6)
        found.append(_drive_steadily(car, speed_mps, WAY_M))
        found.append(_drive_steadily(car, -BACK_MPS, start_m - distance_m(car)))
        stand(car, 0.0, 6)
        now = {**now, **_better(found, now, way)}
    car.release()
    return found


def drive_locks(car: CalibratedCar, most_rad: float) -> None:
    """Drive with the wheels turned as far as they are wanted, to the left and to the right."""
    stand(car, 0.0, 0)
    start_m = distance_m(car)
    for steering_rad in (most_rad, -most_rad):
        drive_there_and_back(car, LOCK_M, steering_rad, start_m)
        stand(car, steering_rad)
    car.release()


def _drive_steadily(car: PulsedCar, speed_mps: float, way_m: float) -> PulseSpeed:
    """Drive a way at one pulse; return it with the speed that came of it."""
    if way_m > 0:
        check_room(car, way_m)
    begin_s, begin_m = car.now_s, distance_m(car)
    pulse_us = math.nan
    while abs(distance_m(car) - begin_m) < abs(way_m):
        car.send(speed_mps, 0.0)
        car.wait()
        if car.throttle_us != pulse_us:
            pulse_us, begin_s = car.throttle_us, car.now_s
        if car.now_s - begin_s > SLOWEST_S:
            raise CalibrationError(
                f"{abs(distance_m(car) - begin_m):.2f} m in {SLOWEST_S:.0f} s at {pulse_us:.0f} us: the car hardly"
                " moves; is its way free, its battery charged?"
            )
    end_s = car.now_s
    stand(car, 0.0, 0)
    speed = steady_mps(car.seen.trace().between(begin_s, end_s))
    if speed is None or speed * way_m <= 0:
        raise CalibrationError("too few scans came on the way: what does `wallride doctor --only lidar` say?")
    return PulseSpeed(pulse_us, speed)


def _better(found: list[PulseSpeed], now: Mapping[str, float], way: float) -> dict[str, float]:
    """Return the pulses that these ways tell so far: of the line, and before there is one with the slope in effect."""
    fit = fit_throttle(found, way)
    if not fit.us_per_mps.why:
        slope = min(max(fit.us_per_mps.value, 5.0), 500.0)
        return {
            proposals.FORWARD: fit.forward_us.value, proposals.REVERSE: fit.reverse_us.value, proposals.THROTTLE: slope,
        }  # fmt: skip
    begins_us = [
        [one.pulse_us - way * now[proposals.THROTTLE] * one.speed_mps for one in found if one.speed_mps * side > 0]
        for side in (1, -1)
    ]
    forward_us, reverse_us = (sum(side) / len(side) for side in begins_us)
    return {proposals.FORWARD: forward_us, proposals.REVERSE: reverse_us}


def _sweep(car: PulsedCar, neutral_us: float, way: float, forward: float) -> float | None:
    """Go away from neutral pulse by pulse until the car moves; return that pulse, None where none moved it.

    forward: 1, or -1 where it is to move backward.
    """
    begin_m = distance_m(car)
    for off_us in SWEEP_US:
        pulse_us, begin_s = neutral_us + way * off_us, car.now_s
        while car.now_s - begin_s < DWELL_S:
            car.pulse(pulse_us)
            car.wait()
            moved_m = (distance_m(car) - begin_m) * forward
            if moved_m > MOVED_M:
                return pulse_us
            if moved_m < -MOVED_M:
                raise CalibrationError(BACKWARD)
    return None


def _keep(car: PulsedCar, neutral_us: float, duration_s: float) -> None:
    """Keep a neutral; CalibrationError where the car drives by it."""
    begin_s, begin_m = car.now_s, distance_m(car)
    while car.now_s - begin_s < duration_s:
        car.pulse(neutral_us)
        car.wait()
        if abs(distance_m(car) - begin_m) > MOVED_M:
            raise CalibrationError(MOVES.format(neutral_us))


def _brake(car: PulsedCar, brake_us: float) -> None:
    """Brake until the car stands; CalibrationError where it drives backward instead."""
    most_m, begin_s = distance_m(car), car.now_s
    stands_s = car.now_s
    while car.now_s - stands_s < DWELL_S:
        car.pulse(brake_us)
        car.wait()
        most_m = max(most_m, distance_m(car))
        if _speed_mps(car):
            stands_s = car.now_s
        if most_m - distance_m(car) > BACK_M:
            raise CalibrationError(NO_BRAKE)
        if car.now_s - begin_s > STANDS_WITHIN_S:
            raise CalibrationError(f"the car does not stand {STANDS_WITHIN_S:.0f} s after a pulse of {brake_us:.0f} us")


def _rest(car: PulsedCar, neutral_us: float) -> None:
    """Roll out in neutral; CalibrationError where the car goes on."""
    begin_s = car.now_s
    car.pulse(neutral_us)
    car.wait()
    while _speed_mps(car):
        car.pulse(neutral_us)
        car.wait()
        if car.now_s - begin_s > STANDS_WITHIN_S:
            raise CalibrationError(MOVES.format(neutral_us))


def _speed_mps(car: CalibratedCar) -> float:
    return car.seen.motor[-1][2]
