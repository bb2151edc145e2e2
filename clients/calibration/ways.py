"""Ways that are driven for a calibration, each from standstill to standstill, while the operator holds the deadman."""

import math
from collections.abc import Callable
from typing import Protocol

from wallride.runtime.calibration.trace import STANDS_BELOW_MPS, TraceBuilder

STAND_SCANS = 28
FIRST_STAND_SCANS = 16
"""Enough for a stop whatever the phases of scans and motor reports: the direction must show, always."""
WALK_MPS = 0.4
BEND_RAD = 0.25
FIRST_M = 0.2
LONG_M, WAY_M, SHORT_M = 1.3, 0.9, 0.4
"""Ways of different lengths tell what the wheels slide at the end of each."""
WEAVE_RAD, WEAVE_EVERY_S = 0.2, 0.5
WEAVE_MPS, WEAVE_SPEED_EVERY_S = (0.3, 0.7), 0.7
WEAVE_M = 1.8
WEAVES = 3
RUN_MPS, RUN_M, RUNS = 1.2, 1.2, 4
MARGIN_M = 0.5
"""Free way ahead of the lidar beyond the driven way, for bumper and stop."""
STANDS_WITHIN_S = 3.0
SLOWEST_SHARE, SCANS_HZ = 3.0, 20.0


class CalibrationError(Exception):
    """A step cannot be driven; the text says why and what to do."""


class CalibratedCar(Protocol):
    """A car that is driven for a calibration. seen: everything that it reported so far."""

    seen: TraceBuilder

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Ask for a drive for a moment; CalibrationError when the operator let go, or the car does not obey."""

    def release(self) -> None:
        """Let go: the car stays stopped, also while nothing is sent."""

    def wait(self) -> None:
        """Wait for the next scan."""

    @property
    def now_s(self) -> float:
        """Return the time of the newest scan."""


def stand(car: CalibratedCar, steering_rad: float = 0.0, scans: int = STAND_SCANS) -> None:
    """Stand for some scans, the wheels turned."""
    begin_s = car.now_s
    while not _stands(car):
        car.send(0.0, steering_rad)
        car.wait()
        if car.now_s - begin_s > STANDS_WITHIN_S and not _stands(car):
            raise CalibrationError(
                "the car does not come to a stop: is the brake current of the motor 0, or motor.brake_us no brake?"
            )
    for _ in range(scans):
        car.send(0.0, steering_rad)
        car.wait()


def drive_way(car: CalibratedCar, way_m: float, speed_mps: float, steering_rad: float = 0.0) -> None:
    """Drive a way, backward where it is negative."""
    drive_varied(car, way_m, lambda _since_s: speed_mps, lambda _since_s: steering_rad)


def drive_varied(
    car: CalibratedCar, way_m: float, speed: Callable[[float], float], steering: Callable[[float], float]
) -> None:
    """Drive a way at a speed, and with a wheel angle, by the time since the beginning."""
    if way_m > 0:
        check_room(car, way_m)
    begin_s, begin_m = car.now_s, distance_m(car)
    limit = round((SLOWEST_SHARE * abs(way_m) / speed(0.0) + 2.0) * SCANS_HZ)
    waited = 0
    last_rad = steering(0.0)
    while abs(distance_m(car) - begin_m) < abs(way_m):
        since_s = car.now_s - begin_s
        last_rad = steering(since_s)
        car.send(math.copysign(speed(since_s), way_m), last_rad)
        car.wait()
        waited += 1
        if waited > limit:
            raise CalibrationError(
                f"{abs(distance_m(car) - begin_m):.2f} m in {since_s:.0f} s: the car does not move; is it blocked"
                " or disarmed? `wallride status` says what it waits for"
            )
    stand(car, last_rad, 0)


def drive_first(car: CalibratedCar) -> None:
    """Drive a short way forward, from which the direction of the motor shows, and back."""
    stand(car, 0.0, FIRST_STAND_SCANS)
    drive_way(car, FIRST_M, WALK_MPS)
    stand(car, 0.0, FIRST_STAND_SCANS)
    drive_way(car, -FIRST_M, WALK_MPS)
    _finish(car)


def drive_arcs(car: CalibratedCar) -> None:
    """Drive to and fro: straight, to the left, to the right, and in wider bends."""
    stand(car, 0.0, 0)
    start_m = distance_m(car)
    for steering_rad, long_m in (
        (0.0, LONG_M), (BEND_RAD, WAY_M), (-BEND_RAD, WAY_M), (0.0, SHORT_M), (BEND_RAD / 2, WAY_M),
        (-BEND_RAD / 2, WAY_M),
    ):  # fmt: skip
        drive_there_and_back(car, long_m, steering_rad, start_m)
    _finish(car)


def drive_there_and_back(car: CalibratedCar, way_m: float, steering_rad: float, start_m: float) -> None:
    """Drive a bend forward and back to where the car started: one that rolls out gets no farther from there."""
    stand(car, steering_rad)
    drive_way(car, way_m, WALK_MPS, steering_rad)
    stand(car, steering_rad)
    drive_way(car, start_m - distance_m(car), WALK_MPS, steering_rad)


def drive_straight(car: CalibratedCar) -> float:
    """Drive forward, stay there, and return the way by the motor's report."""
    stand(car, 0.0, 6)
    begin_m = distance_m(car)
    drive_way(car, LONG_M, WALK_MPS)
    _finish(car)
    return distance_m(car) - begin_m


def drive_weaves(car: CalibratedCar) -> None:
    """Drive to and fro with quick changes of steering and speed."""
    slow_mps, fast_mps = WEAVE_MPS
    for _ in range(WEAVES):
        for way_m in (WEAVE_M, -WEAVE_M):
            stand(car, 0.0, 6)
            drive_varied(
                car, way_m,
                lambda t: fast_mps if int(t / WEAVE_SPEED_EVERY_S) % 2 else slow_mps,
                _weave_rad,
            )  # fmt: skip
    _finish(car)


def drive_stops(car: CalibratedCar) -> None:
    """Drive fast for this purpose, and stop; back at walking speed."""
    stand(car, 0.0, 0)
    begin_m = distance_m(car)
    for _ in range(RUNS):
        stand(car, 0.0, 6)
        drive_way(car, RUN_M, RUN_MPS)
        stand(car, 0.0, 16)
        drive_way(car, begin_m - distance_m(car), WALK_MPS)
    _finish(car)


def check_room(car: CalibratedCar, way_m: float) -> None:
    """CalibrationError where something is nearer than the way ahead."""
    if not car.seen.scans:
        raise CalibrationError("no scan has come: what does `wallride status` say of the lidar?")
    near_m, needed_m = car.seen.nearest_ahead_m(), way_m + MARGIN_M
    if near_m < needed_m:
        raise CalibrationError(
            f"something is {near_m:.2f} m ahead of the lidar, and the way needs {needed_m:.1f} m: move the car"
        )


def _finish(car: CalibratedCar) -> None:
    stand(car)
    car.release()


def _stands(car: CalibratedCar) -> bool:
    return bool(car.seen.motor) and abs(car.seen.motor[-1][2]) < STANDS_BELOW_MPS


def distance_m(car: CalibratedCar) -> float:
    """Return the way so far, as the car reports it."""
    if not car.seen.motor:
        raise CalibrationError("the motor controller reports nothing: what does `wallride status` say of it?")
    return car.seen.motor[-1][1]


def _weave_rad(since_s: float) -> float:
    """Return left and right in turns; half a turn at first, so that the way stays in a line."""
    return WEAVE_RAD if int(since_s / WEAVE_EVERY_S + 0.5) % 2 else -WEAVE_RAD
