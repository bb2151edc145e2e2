"""Presses of the operator that the desk's tests send."""

from wallride.runtime.wire.teleop import Press

BOTH = ["required", "always"]
MANUAL, AUTONOMY, ESTOP, RESET = Press.MANUAL, Press.AUTONOMY, Press.ESTOP, Press.RESET
TAKE_OVER, GOODBYE, NOTHING = Press.TAKE_OVER, Press.GOODBYE, Press(0)
