"""What `wallride calibrate` of a car by servo pulses refuses before it drives; what the doctor says of pulses."""

import pytest

from wallride.cli import main
from wallride.clients.calibration.ways import CalibrationError
from wallride.doctor.computer import this_computer
from wallride.doctor.findings import Level
from wallride.doctor.motor import judge_pulses
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.pulses import command
from wallride.runtime.settings.tree import load_settings


@pytest.fixture
def simulated(car_toml):
    car_toml.write_text('[motor]\ndriver = "maestro"\n[recording]\nsimulated = true\n')
    return car_toml


def test_which_file_is_a_pulsed_cars(car_toml, tmp_path):
    assert command.pulsed_settings(car_toml) is not None
    other = tmp_path / "vesc.toml"
    other.write_text("[car]\n")
    assert command.pulsed_settings(other) is None
    assert command.pulsed_settings(tmp_path / "none.toml") is None


def test_a_step_that_needs_a_tachometer_says_so(simulated, capsys):
    assert main(["calibrate", "delay", "--yes", "--config", str(simulated)]) == 0
    said = capsys.readouterr().out
    assert "delay: it compares commands with the motor's own report, which a car by servo pulses has not" in said
    assert "nothing was measured, and nothing was written" in said


def test_no_key_is_held_for_a_real_car(car_toml, capsys):
    assert main(["calibrate", "--yes", "--config", str(car_toml)]) == 2
    assert "simulated and emulated cars only" in capsys.readouterr().err


def test_a_running_car_is_refused(car_toml, monkeypatch):
    settings = load_settings(car_toml)
    monkeypatch.setattr(command, "running_car", lambda *_: 4711)
    with pytest.raises(CalibrationError, match=r"wallride run, process 4711.*Ctrl-C"):
        command.refuse_running_car(this_computer(), settings)


def test_a_running_service_is_refused(tmp_path, car_toml, monkeypatch):
    active = tmp_path / "active"
    active.symlink_to("somewhere")
    monkeypatch.setattr(command, "ACTIVE", str(active))
    with pytest.raises(CalibrationError, match="systemctl stop wallride"):
        command.refuse_running_car(this_computer(), load_settings(car_toml))


@pytest.mark.parametrize("driver", [MaestroSettings, Pca9685Settings])
def test_the_doctor_names_the_next_step_for_pulses_that_are_the_defaults(driver):
    found = judge_pulses(driver())
    assert found.level is Level.WARN
    assert "wallride calibrate" in found.remedy
    assert judge_pulses(driver(neutral_us=1530.0, forward_us=1575.0)).level is Level.OK


def test_values_in_effect_are_those_of_the_file(car_toml):
    now = command.values_of(load_settings(car_toml))
    assert now["motor.neutral_us"] == 1500.0
    assert now["car.max_steering_rad"] > 0
