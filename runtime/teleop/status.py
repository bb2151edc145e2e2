"""The operator's side as shown outside: in the status, the log of a race, a page."""

from collections.abc import Mapping
from dataclasses import asdict
from enum import StrEnum
from typing import Any

from wallride.drivers.value import value
from wallride.runtime.arbitration.emergency_stop import Cause
from wallride.runtime.wire.teleop import CarCondition


class OperatorState(StrEnum):
    """States of the operator's side; the first that applies, most urgent first."""

    ESTOP = "e-stop"
    LOST = "operator lost"
    REARM = "release everything"
    MANUAL = "manual"
    AUTONOMY = "autonomy"
    WAITING = "waiting for a press"
    """Everything is released, and autonomy waits for the operator to act after an incident."""
    RELEASED = "released"
    ABSENT = "nobody"


@value()
class DeskFacts:
    """State of the desk at one moment, from which the shown state is derived.

    present, lost: the operator's commands are fresh; an operator fell silent and no client has acted since.
    must_release: a press is not obeyed, and a client that could operate presses or may do so.
    holding, incident: as in `TeleopStatements`. permitted: autonomy may move now. alone: it needs no permit.
    """

    e_stop: Mapping[Cause, str]
    present: bool
    lost: bool
    must_release: bool
    holding: OperatorState
    incident: str
    permitted: bool
    alone: bool

    def standing(self) -> OperatorState:
        """Return the state of the operator's side."""
        if self.e_stop:
            return OperatorState.ESTOP
        if self.lost:
            return OperatorState.LOST
        if self.must_release:
            return OperatorState.REARM
        if self.holding is not OperatorState.RELEASED:
            return self.holding
        if self.incident:
            return OperatorState.WAITING
        return OperatorState.RELEASED if self.present else OperatorState.ABSENT

    def condition(self) -> CarCondition:
        """Return the flags of a heartbeat."""
        return CarCondition(
            bool(self.e_stop) * CarCondition.ESTOP_LATCHED
            + self.permitted * CarCondition.PERMITTED
            + self.present * CarCondition.OPERATOR_PRESENT
            + self.lost * CarCondition.OPERATOR_LOST
            + self.must_release * CarCondition.REARM
            + (Cause.MOTOR in self.e_stop) * CarCondition.FAULT
            + self.alone * CarCondition.ALONE
        )


@value()
class OperatorView:
    """The operator's side at one moment.

    operator, session: name of the operator, and session as 16 hexadecimal digits; "" without an operator.
    sessions: clients heard lately. accepted: commands that were fresh and new.
    age_s: since the operator's last such command. round_trip_s: age of the heartbeat in it on arrival.
    reason: why a press is not obeyed or autonomy waits; "" when neither.
    permit: the permit's last reason. permitted: whether it allows autonomy to move now.
    e_stop: causes of the emergency stop with their reasons. refused: commands not obeyed, by kind.
    """

    standing: OperatorState
    operator: str
    session: str
    sessions: int
    accepted: int
    age_s: float | None
    round_trip_s: float | None
    reason: str
    permit: str
    permitted: bool
    e_stop: Mapping[str, str]
    refused: Mapping[str, int]

    def fields(self) -> dict[str, Any]:
        """Return plain values for the status."""
        return {**asdict(self), "standing": str(self.standing)}
