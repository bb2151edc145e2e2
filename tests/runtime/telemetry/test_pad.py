"""What an operator holds, as a pad that ROS programs know."""

import pytest

from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.telemetry.pad import AXES, BUTTONS, axes_and_buttons
from wallride.runtime.wire.teleop import Command, Input, Press


def command(flags, **values):
    return Command(1, 1, 1, 1, flags, Input.KEYBOARD, **values)


@pytest.mark.parametrize(
    ("flags", "pressed"),
    [
        (Press(0), set()),
        (Press.MANUAL, {4}),
        (Press.AUTONOMY, {5}),
        (Press.ESTOP | Press.MANUAL, {1, 4}),
        (Press.RESET, {7}),
        (Press.TAKE_OVER, {3}),
    ],
)
def test_each_press_is_its_button(flags, pressed):
    _, buttons = axes_and_buttons(command(flags), CarSettings())
    assert {button for button in range(BUTTONS) if buttons[button]} == pressed


def test_the_sticks_are_shares_of_the_cars_limits_and_never_more():
    car = CarSettings(max_speed_mps=4.0, max_steering_rad=0.4)
    axes, _ = axes_and_buttons(command(Press.MANUAL, speed_mps=-1.0, steering_rad=0.2), car)
    assert axes == [0.0, -0.25, 1.0, pytest.approx(0.5), 0.0, 1.0, 0.0, 0.0]
    axes, _ = axes_and_buttons(command(Press.MANUAL, speed_mps=9.0, steering_rad=-0.5), car)
    assert (axes[1], axes[3], len(axes)) == (1.0, -1.0, AXES)
