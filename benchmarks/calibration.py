"""How exact `wallride calibrate` is: planted errors over seeds, and the five wall tests before and after.

`python -m benchmarks.calibration [SEEDS]`, in virtual time. Conditions: 20 mm of noise, 2 % outliers, 2 % drop-outs,
own parts of three kinds in turn; delays of 60 ms; a room of 6.6 x 5.7 m with two round things. The servo's limits
are wide, so that a car with another middle of the servo can steer as far.
"""

import sys
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tests.runtime.calibration.planted import (
    ERRORS,
    MOUNT,
    SLOW,
    TRUE_OFFSET_RAD,
    TRUE_SPEED,
    YAW_RAD,
    arcs_of,
    braking_of,
    delays_of,
    planted_car,
)
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.calibration import proposals
from wallride.runtime.calibration.proposals import of_arcs, of_delays
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.car.wiring import WiringConversion
from wallride.sim.lab.courses.walls import REPORT_COURSES, case_of
from wallride.sim.lab.figures import errors
from wallride.sim.lab.laws import build, settings_of
from wallride.sim.virtual.closed_loop import drive

PARTS = ("posts", "cables", "film", "none")
CONFIGURED = {
    proposals.SPEED_GAIN: 4614.0, proposals.WHEELBASE: 0.25, proposals.SERVO_GAIN: -1.2135,
    proposals.SERVO_OFFSET: 0.5304, proposals.LIDAR_X: 0.27, proposals.LIDAR_Y: 0.0, proposals.LIDAR_YAW: 0.0,
    proposals.LATENCY: 0.03, proposals.ACTUATION: 0.05, proposals.GRIP: 0.8, "motor.servo_min": 0.05,
    "motor.servo_max": 0.99,
}  # fmt: skip
WIRED = ERRORS.wired(VescSettings())
RIGHT = {
    **CONFIGURED, proposals.SPEED_GAIN: WIRED.speed_to_erpm_gain, proposals.WHEELBASE: 0.33,
    proposals.SERVO_OFFSET: WIRED.steering_to_servo_offset, proposals.LIDAR_X: 0.29, proposals.LIDAR_Y: 0.02,
    proposals.LIDAR_YAW: YAW_RAD, proposals.LATENCY: 0.0725, proposals.ACTUATION: 0.09,
}  # fmt: skip
SPEEDS_MPS = (1.0, 2.0)


def main() -> None:
    """Print a line of errors for each seed, then the five wall tests."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    print("errors: speed %, wheelbase %, offset deg, lidar yaw deg, x cm, y cm, servo ms, motor ms, deceleration %")
    found = [calibrated(seed) for seed in range(seeds)]
    print("greatest:", " ".join(f"{value:.2f}" for value in np.abs([row for row, _ in found]).max(axis=0)))
    usual, (_, told) = wall_errors(None, 1.0, seeds), calibrated(0, VehicleSettings())
    after = wall_errors(told, 1.0, seeds, VehicleSettings())
    show("1.0 m/s, usual car", usual)
    show("1.0 m/s, planted but 20 ms", wall_errors(CONFIGURED, 1.0, seeds, VehicleSettings()))
    show("1.0 m/s, calibrated", after)
    print("    calibrated over usual, %:", " ".join(f"{100 * share:+.1f}" for share in after / usual - 1))
    for speed_mps in SPEEDS_MPS:
        show(f"{speed_mps} m/s, usual car, 20 ms", wall_errors(None, speed_mps, seeds))
        show(f"{speed_mps} m/s, planted errors", wall_errors(CONFIGURED, speed_mps, seeds))
        right = wall_errors(RIGHT, speed_mps, seeds)
        show(f"{speed_mps} m/s, right settings", right)
        after = np.mean([wall_errors(settings, speed_mps, seeds) for _, settings in found[:3]], axis=0)
        show(f"{speed_mps} m/s, calibrated (3)", after)
        print("    calibrated over right, %:", " ".join(f"{100 * share:+.1f}" for share in after / right - 1))


def calibrated(seed: int, vehicle: VehicleSettings = SLOW) -> tuple[list[float], Mapping[str, float]]:
    """Return the errors of one calibration, and the settings after it."""
    car = planted_car(seed, own_parts=PARTS[seed % len(PARTS)], vehicle=vehicle)
    arcs = arcs_of(car)
    fit = arcs.fit
    servo, motor = delays_of(car, arcs)
    braking = braking_of(car, arcs, motor.delay_s.value)
    row = [
        100 * (fit.speed_factor.value / TRUE_SPEED - 1), 100 * (fit.wheelbase_m.value / 0.33 - 1),
        np.degrees(fit.offset_rad.value - TRUE_OFFSET_RAD), np.degrees(fit.lidar_yaw_rad.value - YAW_RAD),
        100 * (fit.lidar_x_m.value - 0.29), 100 * (fit.lidar_y_m.value - 0.02),
        1000 * (servo.delay_s.value - vehicle.steering_delay_s),
        1000 * (motor.delay_s.value - vehicle.drive_delay_s),
        100 * (braking.value / (0.8 * 9.81) - 1),
    ]  # fmt: skip
    print(f"seed {seed:2} {PARTS[seed % len(PARTS)]:6}", " ".join(f"{value:+6.2f}" for value in row), flush=True)
    new = [*of_arcs(fit, CONFIGURED, ruler=False), *of_delays(servo, motor, CONFIGURED, 0.025)]
    return row, {**CONFIGURED, **{one.name: one.new for one in new if one.new is not None}}


def wall_errors(
    settings: Mapping[str, float] | None, speed_mps: float, seeds: int, vehicle: VehicleSettings = SLOW
) -> np.ndarray:
    """Return the mean distance error [m] of each course, both sides; None: the usual car."""
    return np.array(
        [np.mean([_error_m(name, settings, speed_mps, k, vehicle) for k in range(seeds)]) for name in REPORT_COURSES]
    )


def _error_m(
    course: str, settings: Mapping[str, float] | None, speed_mps: float, seed: int, true: VehicleSettings
) -> float:
    side = "left" if seed % 2 else "right"
    case = case_of(course, speed_mps, 0.8, side, seed)
    texts = [f"{name}={value}" for name, value in (settings or {}).items()]
    car = settings_of("ball", side, case.desired_m, speed_mps, texts)
    vehicle, wiring, mount = VehicleSettings(), None, {}
    if settings is not None:
        vehicle, wiring, mount = true, WiringConversion(car.motor, WIRED), MOUNT
    case = replace(
        case, car=car.car, vehicle=vehicle, wiring=wiring, lidar=case.lidar.model_copy(update=mount),
        lidar_yaw_rad=car.lidar.yaw_rad,
    )  # fmt: skip
    run = drive(case, *build("ball", side, case.desired_m, speed_mps, texts))
    return float(errors(run)["mean_error_m"] or np.nan) if run.contact is None else float("nan")


def show(title: str, errors_m: np.ndarray) -> None:
    """Print one row of the wall tests."""
    print(
        f"{title:28}", " ".join(f"{name} {1000 * m:5.1f} mm" for name, m in zip(REPORT_COURSES, errors_m, strict=True))
    )


if __name__ == "__main__":
    main()
