"""What an operator holds, as ROS programs read it of the pad that joins most cars: an Xbox pad, or an F710 at X.

Axes and buttons are numbered as `joy_node` of ROS numbers them; scripts for a car with ROS read LB and RB as deadman of
manual driving and of autonomy. Axes are shares of the car's limits: the client has shaped the sticks already.
"""

from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.wire.teleop import Command, Press

SPEED_AXIS, STEERING_AXIS = 1, 3
TRIGGER_AXES = (2, 5)
"""At rest these are 1."""
AXES, BUTTONS = 8, 11
B, Y, LB, RB, START = 1, 3, 4, 5, 7
PRESSES = {Press.ESTOP: B, Press.TAKE_OVER: Y, Press.MANUAL: LB, Press.AUTONOMY: RB, Press.RESET: START}


def axes_and_buttons(command: Command, car: CarSettings) -> tuple[list[float], list[int]]:
    """Return the axes, -1 to 1, positive forward and to the left, and the buttons, 0 or 1."""
    axes, buttons = [0.0] * AXES, [0] * BUTTONS
    for axis in TRIGGER_AXES:
        axes[axis] = 1.0
    axes[SPEED_AXIS] = _share(command.speed_mps, car.max_speed_mps)
    axes[STEERING_AXIS] = _share(command.steering_rad, car.max_steering_rad)
    for press, button in PRESSES.items():
        buttons[button] = int(press in command.flags)
    return axes, buttons


def _share(value: float, limit: float) -> float:
    return max(-1.0, min(value / limit, 1.0))
