"""The deadman of a script: a drive that is not renewed within HOLD_S is let go. Pure: time is an argument.

A script is an operator like any other (docs/decisions/0008-teleop-protocol.md): it releases everything first, then
presses, and echoes the car's heartbeat. Once it stalled, or the car took the deadman from it, nothing that it sends
moves the car again: it has to begin anew.
"""

import math
from typing import Final

from wallride.clients.teleop.inputs import Control, Inputs
from wallride.clients.teleop.pilot import DeadmanFault, PilotState
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.wire.teleop import Input, Press

HOLD_S: Final = 0.2
"""Duration for which one `send` holds."""
UNHEEDED_S: Final = 1.0
"""Duration of pressing without any effect after which the car does not want this client."""
UNHEEDED: Final = (
    "the car takes no command of it: is the link fast enough, and over tls your certificate's role operator or admin?"
)
NO_RAMP_MPS2: Final = 1e6
"""The car's limiter bounds the acceleration."""


class ScriptedHand:
    """What the script holds at a time, and whether it may still drive.

    trouble: why it may not, "" while it may. driving: the car is asked to move by it; asked: it was at some time.
    stopping: it presses the e-stop.
    """

    def __init__(self, max_speed_mps: float, max_steering_rad: float) -> None:
        if not (0 < max_speed_mps < math.inf and 0 < max_steering_rad < math.inf):
            raise ValueError("max_speed_mps and max_steering_rad must be positive and finite")
        self.shape = InputShape(max_speed_mps, max_steering_rad, deadzone=0.0, expo=0.0, ramp_mps2=NO_RAMP_MPS2)
        self.trouble = ""
        self.driving = self.asked = self.stopping = False
        self._sent_s = -math.inf
        self._speed = self._steering = 0.0
        self._pressed = False

    def send(self, speed_mps: float, steering_rad: float, now_s: float) -> None:
        """Hold a drive from now on, for HOLD_S; ValueError for no number. More than the limits is the limit."""
        if not (math.isfinite(speed_mps) and math.isfinite(steering_rad)):
            raise ValueError(f"speed {speed_mps} m/s, steering {steering_rad} rad: both must be numbers")
        self._speed = max(-1.0, min(speed_mps / self.shape.max_speed_mps, 1.0))
        self._steering = max(-1.0, min(steering_rad / self.shape.max_steering_rad, 1.0))
        self._sent_s, self.driving, self.asked = now_s, True, True

    def release(self) -> None:
        """Let go on purpose: the car stops, unless it may drive by itself; the next `send` presses again."""
        self.driving = self._pressed = False

    def press_e_stop(self) -> None:
        """Press the e-stop, until the end."""
        self.stopping = True

    def inputs(self, now_s: float) -> Inputs:
        """Return what is held now."""
        if self.driving and not self.trouble and now_s - self._sent_s > HOLD_S:
            self.trouble = f"nothing was sent for {HOLD_S} s"
        if self.stopping:
            return Inputs(Input.SCRIPT, live=True, event_s=now_s, pressed=frozenset({Control.ESTOP}), device="script")
        if self.trouble:  # unsure: a stop, and no release
            return Inputs(Input.SCRIPT, live=False, event_s=now_s, device="script")
        if not self.driving:
            return Inputs(Input.SCRIPT, live=True, event_s=now_s, device="script")
        first, self._pressed = not self._pressed, True  # a deadman is pressed with centred sticks
        return Inputs(
            Input.SCRIPT, live=True, event_s=now_s, pressed=frozenset({Control.MANUAL}),
            speed=0.0 if first else self._speed, steering=0.0 if first else self._steering, device="script",
        )  # fmt: skip

    def note(self, state: PilotState) -> None:
        """Take in what became of the last command; one in which nothing was pressed says nothing about driving."""
        # `send` comes from the script's thread, perhaps since `inputs` was read: that press is not in this command yet.
        if not self.driving or self.trouble or not state.inputs.pressed:
            return
        if state.block is not DeadmanFault.NONE or state.flags != Press.MANUAL:
            self.trouble = str(state.block or state.closed_by or DeadmanFault.HELD)
        elif state.unminded_s > UNHEEDED_S:
            self.trouble = UNHEEDED
