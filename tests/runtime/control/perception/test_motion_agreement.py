"""The scene's motion against the wheels', of simulated cars that roll, slide and stand, and of real drives."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.runtime.control.perception.test_plausibility import PERIOD_S, Room
from tests.runtime.control.scans import CAR
from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.motion_agreement import HOLDS_AFTER_S, Agreement, MotionAgreement
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.sim.recordings import load_recording
from wallride.sim.recordings.scans import motion_of, motor_at, scans_of

RACECAR = Path(__file__).resolve().parents[4] / ".." / "shared" / "data" / "racecar"


class Witness:
    """Judge of a Room that keeps what the agreement says."""

    def __init__(self):
        self.agreement = MotionAgreement(CAR.lidar_m)
        self.said = []

    def look(self, percept, *, odometry_check):
        assert odometry_check
        self.said.append(self.agreement.learn(percept.scan, percept.motor, percept.pose))


@pytest.mark.parametrize(
    ("told", "yaw_rad", "answer"),
    [
        (1.0, 0.0, Agreement.AGREES), (0.6, 0.0, Agreement.AGREES), (-1.0, 0.0, Agreement.OPPOSITE),
        (0.33, 0.0, Agreement.FARTHER), (1.0, 1.5, Agreement.ASIDE),
    ],
)  # fmt: skip
def test_the_answer_is_the_ratio_of_scene_and_wheels(told, yaw_rad, answer):
    way_m = 1.2 if told == 0.33 else 0.6
    room = Room("cluttered", judge=Witness(), yaw_rad=yaw_rad)
    room.drive(way_m, told=told)
    found = {one for one in room.plausibility.said if one is not Agreement.UNKNOWN}
    assert found == {answer}


def test_wheels_in_the_air_stand():
    room = Room("cluttered", judge=Witness())
    for _ in range(24):
        room.step(0.0, told=1.0)
    assert set(room.plausibility.said) == {Agreement.UNKNOWN, Agreement.STANDS}


def test_an_answer_needs_three_windows():
    room = Room("cluttered", judge=Witness())
    room.drive(0.25)
    assert set(room.plausibility.said) == {Agreement.UNKNOWN}
    room.drive(0.15)
    assert Agreement.AGREES in room.plausibility.said


def test_after_the_wheels_locked_nothing_is_said_until_they_hold_again():
    """A full brake on a slippery floor: the wheels report a third of the way, for 0.25 s at a time."""
    room = Room("cluttered", judge=Witness())
    for _ in range(6):
        for _ in range(4):
            room.step(1.5, told=1.0)
        for _ in range(round(HOLDS_AFTER_S / PERIOD_S) - 1):
            room.step(1.5, told=0.3)
    assert set(room.plausibility.said) == {Agreement.UNKNOWN}


def test_a_scene_without_enough_walls_says_nothing():
    room = Room("cluttered", judge=Witness())
    room.lidar = room.lidar.model_copy(update={"range_max_m": 0.3})
    room.drive(1.0)
    assert set(room.plausibility.said) == {Agreement.UNKNOWN}


def recorded(name):
    """Return scans, wheels and poses of a real drive, whose wheels are the scans' own motion."""
    path = RACECAR / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"the recording {path.name} is not here; it lies in shared/data beside the checkout")
    recording = load_recording(path)
    motion = motion_of(recording)
    x_m = motion.x_m - CAR.lidar_x_m * np.cos(motion.yaw_rad)
    y_m = motion.y_m - CAR.lidar_x_m * np.sin(motion.yaw_rad)
    for number, scan in enumerate(scans_of(recording)):
        motor = motor_at(motion, number, 0.0, scan.stamp_s)
        yield scan, motor, OdometryState(float(x_m[number]), float(y_m[number]), float(motion.yaw_rad[number]))


def backwards(pose):
    return OdometryState(-pose.x_m, -pose.y_m, pose.yaw_rad)


def found_along(drive, *, yaw_rad=0.0, seen_as=lambda pose: pose):
    """Return the answers of a drive, each begun anew."""
    agreement, found = MotionAgreement(CAR.lidar_m), []
    for scan, motor, pose in drive:
        turned = replace(scan, angle_min_rad=scan.angle_min_rad + yaw_rad)
        answer = agreement.learn(turned, motor, seen_as(pose))
        if answer is not Agreement.UNKNOWN:
            found.append(answer)
            agreement.forget()
    return found


@pytest.mark.parametrize(
    "name", ["t14_outside_corner_gap14s", "t14_inside_corner_2mps", "t3_wall_data", "t14_straight_1mps"]
)
def test_on_real_drives_true_wheels_agree_and_no_turned_lidar_does(name):
    drive = list(recorded(name))
    true = found_along(drive)
    assert set(true) == {Agreement.AGREES}
    for yaw_deg in (-90, -45, 45, 90):
        turned = found_along(drive, yaw_rad=math.radians(yaw_deg))
        assert set(turned) <= {Agreement.ASIDE, Agreement.HELD_OR_ASIDE}
        assert len(turned) >= 0.7 * len(true)
    opposite = found_along(drive, seen_as=backwards)
    assert set(opposite) <= {Agreement.OPPOSITE, Agreement.HELD_OR_ASIDE}
    assert len(opposite) >= 0.7 * len(true)


def test_reports_of_the_motor_without_a_new_time_are_no_slip():
    room = Room("cluttered", judge=Witness())
    room.step(0.0, told=0.0)
    agreement = MotionAgreement(CAR.lidar_m)
    for speed_mps in (2.0, 0.1, 2.0):
        answer = agreement.learn(room.last, MotorState(1.0, speed_mps, 0.0, 0.0), OdometryState())
    assert answer is Agreement.UNKNOWN
