"""Values that a car drives with before its calibration, compared with its settings file."""

import os
from collections.abc import Mapping
from pathlib import Path

from wallride.clients.calibration.steps import OUTLINE_WORDS
from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.remote.car import RemoteCar
from wallride.runtime.calibration import proposals
from wallride.runtime.parameters.catalogue import values
from wallride.runtime.settings.tree import load_settings

NAMES = (
    proposals.SPEED_GAIN, proposals.WHEELBASE, proposals.SERVO_GAIN, proposals.SERVO_OFFSET, proposals.LIDAR_X,
    proposals.LIDAR_Y, proposals.LIDAR_YAW, proposals.LATENCY, proposals.ACTUATION, proposals.GRIP,
    "car.steering_rate_radps", *proposals.SERVO.ends, *OUTLINE_WORDS,
)  # fmt: skip

PULSE_NAMES = (
    proposals.WHEELBASE, proposals.MOST_STEERING, proposals.PULSE_GAIN, proposals.PULSE_CENTER, *proposals.PULSES.ends,
    proposals.NEUTRAL, proposals.FORWARD, proposals.REVERSE, proposals.THROTTLE, proposals.BRAKE_PULSE,
    "motor.throttle_reach_us", proposals.LIDAR_X, proposals.LIDAR_Y, proposals.LIDAR_YAW, proposals.GRIP,
    *OUTLINE_WORDS,
)  # fmt: skip
"""Of a car by servo pulses."""


def current_values(car: RemoteCar, path: Path | None) -> Mapping[str, float]:
    """Return the values that the car drives with; CalibrationError where its file has others, or it has no tachometer.

    path: None for no file.
    """
    known = car.parameters.describe()
    if proposals.THROTTLE in known:
        raise CalibrationError(
            f"{car.name} has no tachometer, and is measured without its process: sudo systemctl stop wallride, then"
            " wallride calibrate in a terminal on its computer"
        )
    now = {name: float(known[name]["value"]) for name in NAMES if name in known}
    if path is None:
        return now
    here = values(load_settings(path))
    for name, value in now.items():
        if here.get(name) != value:
            raise CalibrationError(
                f"{path} has {name} = {here.get(name)}, and {car.name} drives with {value:g}: is it its file? restart"
                " the car, or give its file with --config"
            )
    return now


def check_writable(path: Path) -> None:
    """CalibrationError where the values could not be written later; to be asked before anything is driven."""
    if not path.is_file():
        raise CalibrationError(f"{path}: there is no such file; give the car's with --config, on the car's computer")
    if not os.access(path, os.W_OK) or not os.access(path.parent, os.W_OK):
        raise CalibrationError(f"{path}: you may not write it, and what is measured goes there: use sudo")
