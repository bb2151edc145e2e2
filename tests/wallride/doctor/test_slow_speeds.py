"""A speed at which the motor does not turn is warned of before the car is to drive at it."""

import pytest

from wallride.cli import main
from wallride.doctor.slow_speeds import SPEEDS, too_slow_to_turn
from wallride.runtime.settings.tree import Settings, load_settings


def test_the_defaults_turn_the_motor():
    assert too_slow_to_turn(Settings()) == ()


@pytest.mark.parametrize("name", SPEEDS)
def test_every_speed_below_the_motor_s_slowest_is_named(name):
    settings = load_settings(None, ["motor.min_speed_mps=0.4", f"{name}=0.3"])
    words = f"{name} = 0.3 m/s is less than motor.min_speed_mps = 0.4 m/s: the motor does not turn at it"
    assert words in too_slow_to_turn(settings)


def test_a_stop_that_is_meant_is_none():
    assert too_slow_to_turn(load_settings(None, ["safety.creep_mps=0"])) == ()


def test_check_warns_and_takes_the_file(tmp_path, capsys):
    file = tmp_path / "car.toml"
    file.write_text("[wall_follow]\nspeed_mps = 0.15\n")
    assert main(["check", str(file)]) == 0
    assert "wallride: wall_follow.speed_mps = 0.15 m/s is less than" in capsys.readouterr().err
