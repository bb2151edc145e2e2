"""Settings: what is refused, and that it says why."""

import pytest
from pydantic import ValidationError

from wallride.drivers.vesc.settings import VescSettings


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"adress": "serial:///dev/x"}, "Extra inputs"),
        ({"driver": "pwm"}, "vesc"),
        ({"address": "ttyACM0"}, "is not an address"),
        ({"address": "tcp://10.0.0.1:65102"}, "a brake must not depend on a network"),
        ({"speed_to_erpm_gain": -4614}, "greater than or equal to 200"),
        ({"speed_to_erpm_gain": 199.9}, "greater than or equal to 200"),
        ({"speed_to_erpm_gain": 100_001}, "less than or equal to 100000"),
        ({"speed_to_erpm_gain": float("nan")}, "finite"),
        ({"brake_current_a": 0.0}, "greater than or equal to 1"),
        ({"steering_to_servo_gain": 0}, "could not steer"),
        ({"servo_min": 0.6, "servo_max": 0.5}, "must be below"),
        ({"steering_to_servo_offset": 0.9}, "straight ahead"),
        ({"lost_after_s": 0.05}, "use 0.060 or more"),
        ({"poll_hz": 0}, "greater than or equal to 10"),
    ],
)
def test_bad_settings_are_refused_with_a_reason(changes, complaint):
    with pytest.raises(ValidationError, match=complaint):
        VescSettings.model_validate(changes)


@pytest.mark.parametrize("name", VescSettings.model_fields)
def test_settings_do_not_change_behind_ones_back(name):
    settings = VescSettings()
    with pytest.raises(ValidationError, match="frozen"):
        setattr(settings, name, getattr(settings, name))


def test_a_bridge_on_this_computer_is_at_hand():
    assert VescSettings(address="tcp://127.0.0.1:65102").address == "tcp://127.0.0.1:65102"
