"""What the teleop tests share: hands, a car that answers, and time that is a variable."""

import math
from collections.abc import Iterable
from dataclasses import replace

from wallride.clients.teleop.inputs import Control, Inputs
from wallride.clients.teleop.pilot import Pilot, PilotState
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.wire.teleop import Beat, CarCondition, Command, Input, Press

SESSION = 77
PERIOD_S = 0.02
LINEAR = InputShape(max_speed_mps=2.0, max_steering_rad=0.4, deadzone=0.0, expo=0.0, ramp_mps2=math.inf)


def hands(*pressed: Control, speed: float = 0.0, steering: float = 0.0, kind: Input = Input.PAD) -> Inputs:
    return Inputs(kind, live=True, event_s=math.nan, pressed=frozenset(pressed), speed=speed, steering=steering)


DEAD = Inputs(Input.PAD, live=False, trouble="unplugged")


class Drive:
    """A pilot, its car's heartbeats, and a clock. `hold` runs cycles; the last command is returned."""

    def __init__(self, feel: InputShape = LINEAR) -> None:
        self.pilot = Pilot(SESSION, "ann", feel)
        self.now_s = 100.0
        self.beating = True
        self.beat = Beat(car_session=9, beat=0, flags=CarCondition(0))
        self.event_s: float | None = None  # a fixed time of the last event; None: an event in every cycle

    @property
    def situation(self) -> PilotState:
        assert self.pilot.situation is not None
        return self.pilot.situation

    def cycle(self, inputs: Inputs) -> Command:
        self.now_s += PERIOD_S
        if self.beating:
            self.beat = replace(self.beat, beat=self.beat.beat + 1)
            self.pilot.hear(self.beat, self.now_s)
        if inputs.live:
            inputs = replace(inputs, event_s=self.now_s if self.event_s is None else self.event_s)
        return self.pilot.step(inputs, self.now_s)

    def hold(self, inputs: Inputs, seconds: float = 0.1) -> list[Command]:
        return [self.cycle(inputs) for _ in range(max(1, round(seconds / PERIOD_S)))]

    def says(self, *conditions: CarCondition, operator: int | None = None, name: str = "") -> None:
        flags = CarCondition(0)
        for condition in conditions:
            flags |= condition
        session = self.beat.operator_session if operator is None else operator
        self.beat = replace(self.beat, flags=flags, operator_session=session, operator_name=name)

    def drive(self, speed: float = 0.5) -> Command:
        """Release everything, press the deadman, then push the stick."""
        self.hold(hands())
        self.hold(hands(Control.MANUAL))
        return self.hold(hands(Control.MANUAL, speed=speed))[-1]


def flags(commands: Iterable[Command]) -> set[Press]:
    return {command.flags for command in commands}
