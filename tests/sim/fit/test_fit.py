"""Planted parameters of a simulated car are found from its recording, and what a drive cannot show is said."""

import argparse
import tomllib

import numpy as np
import pytest

from tests.sim.fit.drives import recorded, straight
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.fit import estimate as estimates
from wallride.sim.fit.command import run
from wallride.sim.fit.drive import intervals, join, read_drive
from wallride.sim.fit.driving import fit_drive
from wallride.sim.fit.estimate import CarEstimate, conditions_text, distance, rows
from wallride.sim.fit.sensor import fit_sensor
from wallride.sim.fit.steering import fit_steering
from wallride.sim.scenario.conditions import RequestedConditions, conditions_of
from wallride.sim.world.beams import LidarSettings

PLANTED = VehicleSettings(
    steering_delay_s=0.07, steering_rate_radps=2.25, trim_rad=0.03, drive_delay_s=0.06, ramp_mps2=3.0, wheelbase_m=0.3
)
ASSUMED = (0.02, 3.2)


@pytest.fixture(scope="module")
def planted():
    lidar = LidarSettings(noise_std_m=0.012, dropout_share=0.01, own_parts="wide")
    return recorded(PLANTED, lidar, gain=1.15)


@pytest.fixture(scope="module")
def found(planted):
    drive = read_drive(planted)
    return CarEstimate(
        ("planted",), drive, fit_steering(drive, 0.33, ASSUMED), fit_drive(drive), fit_sensor(planted, drive.moved_m)
    )


def test_the_scans_alone_show_the_turns():
    drive = read_drive(recorded(duration_s=6.0))
    assert len(drive.motion) == 239
    turned_rad = float(np.sum(drive.motion.yaw_rate_radps * (drive.motion.to_s - drive.motion.from_s)))
    assert drive.odometry is not None
    assert turned_rad == pytest.approx(float(drive.odometry.yaw_rad[-1] - drive.odometry.yaw_rad[0]), abs=0.02)


def test_without_odometry_the_speed_is_the_commanded_one_where_it_has_settled():
    drive = read_drive(recorded(odometry=False))
    assert drive.origin == "commands"
    assert set(drive.speed_mps[np.isfinite(drive.speed_mps)]) <= {0.6, 1.5}
    assert np.count_nonzero(np.isnan(drive.speed_mps)) > 100


def test_what_is_planted_in_the_servo_the_motor_and_the_speed_gain_is_found(found):
    steering = found.steering
    assert steering.delay_s.value == pytest.approx(0.07, abs=0.008)
    assert steering.rate_radps.value == pytest.approx(2.25, abs=0.25)
    assert not steering.delay_s.why
    assert not steering.rate_radps.why
    assert steering.rms_rad < 0.5 * steering.assumed_rms_rad
    assert found.driving.delay_s.value == pytest.approx(0.06, abs=0.06)
    assert found.driving.ramp_mps2.value == pytest.approx(3.0, abs=0.5)
    assert found.driving.speed_gain.value == pytest.approx(1 / 1.15, rel=0.03)


def test_trim_and_wheelbase_are_found_with_the_true_speed():
    drive = read_drive(recorded(PLANTED))
    steering = fit_steering(drive, 0.33, ASSUMED)
    assert steering.trim_rad.value == pytest.approx(0.03 * 0.33 / 0.3, abs=0.004)
    assert steering.wheelbase_m.value == pytest.approx(0.3, abs=0.006)


def test_noise_lost_beams_and_own_parts_are_found(found):
    sensor = found.sensor
    assert sensor.noise_std_m == pytest.approx(0.012, rel=0.1)
    assert sensor.dropout_share == pytest.approx(0.01, rel=0.15)
    assert sensor.part_kind == "wide"
    assert sensor.part_share > 0.9


def test_the_result_is_a_file_of_conditions(found, tmp_path):
    file = tmp_path / "car.toml"
    file.write_text(conditions_text(found))
    made = conditions_of(RequestedConditions(file))
    assert made.vehicle.steering_delay_s == pytest.approx(found.steering.delay_s.value, abs=1e-4)
    assert made.lidar.own_parts == "wide"
    assert "friction" in file.read_text()
    assert "differs from the simulator's" in distance(found)


@pytest.mark.parametrize("speed_mps", [0.8, 2.5])
def test_the_lag_of_the_yaw_is_no_delay_of_the_servo(speed_mps):
    drive = read_drive(recorded(VehicleSettings(steering_delay_s=0.07), speed_mps=speed_mps, duration_s=8.0))
    assert fit_steering(drive, 0.33, ASSUMED).delay_s.value == pytest.approx(0.07, abs=0.008)


def test_a_straight_drive_identifies_no_servo():
    drive = read_drive(recorded(steering=straight, duration_s=6.0))
    steering = fit_steering(drive, 0.33, ASSUMED)
    assert "record a drive with curves" in steering.delay_s.why
    assert "do not tell" in distance(
        CarEstimate(("x",), drive, steering, fit_drive(drive), fit_sensor(recorded(duration_s=1.0), 1.0))
    )


def test_a_car_that_stands_identifies_no_own_parts():
    recording = recorded(speed_mps=0.0, duration_s=1.5, lidar=LidarSettings(own_parts="wide"))
    assert "the car stood" in fit_sensor(recording, 0.0).why


def test_stamps_that_jump_are_not_used():
    motion = intervals(recorded(duration_s=1.0, stamps=False))
    assert np.all(motion.to_s - motion.from_s > 0.02)
    assert len(motion) == 39


def test_several_recordings_are_one_car():
    drives = [read_drive(recorded(duration_s=2.0)), read_drive(recorded(duration_s=3.0, odometry=False))]
    both = join(drives)
    assert len(both.motion) == sum(len(drive.motion) for drive in drives)
    assert np.all(np.diff(both.motion.from_s) > 0)
    assert both.odometry is None
    assert both.command is not None
    assert len(both.command) == sum(len(drive.command or ()) for drive in drives)


def test_without_commands_only_the_sensor_is_estimated():
    drive = read_drive(recorded(duration_s=2.0))
    bare = join([drive, type(drive)(drive.motion, drive.speed_mps, "scans", None, None)])
    assert "no commands" in fit_steering(bare, 0.33, ASSUMED).delay_s.why
    assert "no commands" in fit_drive(bare).delay_s.why
    assert "no odometry" in fit_drive(bare).speed_gain.why


def test_the_command_says_which_file_cannot_be_read(tmp_path, capsys):
    missing = tmp_path / "none.npz"
    options = argparse.Namespace(files=[missing], wheelbase=0.33, topic=None, out=None)
    assert run(options) == 2
    assert "none.npz does not exist" in capsys.readouterr().err


def test_the_command_writes_what_it_shows(planted, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(estimates, "load_recording", lambda _path, _topic: planted)
    out = tmp_path / "car.toml"
    assert run(argparse.Namespace(files=[tmp_path / "a"], wheelbase=0.33, topic=None, out=out)) == 0
    said = capsys.readouterr().out
    assert "steering delay" in said
    assert f"wallride sim --conditions {out}" in said
    written = tomllib.loads(out.read_text())
    assert written["vehicle"]["steering_rate_radps"] == pytest.approx(2.25, abs=0.25)


def test_real_recordings_of_a_car_agree_on_its_servo(shared_data):
    rates = []
    for name in ("t14_straight_2mps", "t14_inside_corner_2mps"):
        found = estimates.estimate([shared_data / f"racecar/{name}.npz"], 0.33)
        assert found.steering.rms_rad < 0.5 * found.steering.assumed_rms_rad
        rates.append(found.steering.delay_s.value)
        assert any(row.name == "own parts" and "film" in row.text for row in rows(found))
    assert rates[0] == pytest.approx(rates[1], abs=0.03)
