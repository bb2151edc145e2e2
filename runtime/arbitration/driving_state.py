"""The car's state in one of nine words, what is true in each, and what clears each.

Describes arbitration and decides nothing: `observe` reads one decision and its circumstances, `STATE_OF` names the
state. Whether a car that stood may move again is decided by the permit and the e-stop, not here.
"""

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from wallride.drivers.api import Clock, Lidar, LinkState, Motor
from wallride.drivers.value import value
from wallride.runtime.arbitration.command import Output, Source
from wallride.runtime.arbitration.emergency_stop import Cause, EmergencyStop
from wallride.runtime.arbitration.permit import Permit


class DrivingState(StrEnum):
    """States of the car, least active first."""

    STARTING = "starting"
    WAITING = "waiting for device"
    DISARMED = "disarmed"
    ARMED = "armed"
    DRIVING = "driving"
    LIMITED = "limited"
    STOPPED = "stopped"
    ESTOPPED = "e-stopped"
    FAULT = "fault (latched)"


class Observation(StrEnum):
    """What is true at a decision. The first that applies counts."""

    FAULT = "fault latched"
    ESTOP = "e-stop pressed"
    DEVICE_MISSING = "device missing"
    NOT_PERMITTED = "no driver permitted"
    IDLE = "no motion asked"
    BLOCKED = "stop decided"
    SLOWED = "slower than asked"
    FREE = "drives as asked"


_S, _O = DrivingState, Observation

STATE_OF: Final[Mapping[Observation, DrivingState]] = MappingProxyType(
    {
        _O.FAULT: _S.FAULT,
        _O.ESTOP: _S.ESTOPPED,
        _O.DEVICE_MISSING: _S.WAITING,
        _O.NOT_PERMITTED: _S.DISARMED,
        _O.IDLE: _S.ARMED,
        _O.BLOCKED: _S.STOPPED,
        _O.SLOWED: _S.LIMITED,
        _O.FREE: _S.DRIVING,
    }
)
"""The state after a decision, for what is true at it; the state before makes no difference."""

PERMIT_AGAIN: Final = "then permit again"
DRIVES_ON: Final = "without an operator the car then drives on by itself"
"""What comes in place of PERMIT_AGAIN where no permit is required."""

CLEARED_BY: Final[Mapping[DrivingState, str]] = MappingProxyType(
    {
        _S.STARTING: "the first decision, within a second of the start",
        _S.WAITING: f"connect or power the device as its line says; {PERMIT_AGAIN}",
        _S.DISARMED: "an operator: hold to drive, or permit autonomy (wallride teleop; Drive on the page)",
        _S.ARMED: "a speed: drive by hand (stick, keys, drive pad of the page) or permit autonomy",
        _S.DRIVING: "",
        _S.LIMITED: "nothing to do: it goes faster again once what the reason names is over",
        _S.STOPPED: "remove what the reason names; the car then drives on by itself while it is permitted",
        _S.ESTOPPED: "release everything, then hold R or Start for 1 s (page: Drive, then Reset), and release it;"
        f" {PERMIT_AGAIN}",
        _S.FAULT: "remedy the fault, then reset as after an e-stop (operator.permit = always retries what the"
        f" controller itself reports); an opened kill switch needs no reset; {PERMIT_AGAIN}",
    }
)
"""What ends each state; "" for the one that is wanted."""

BATTERY_CLEARED_BY: Final = f"a good voltage for 2 s (battery.settle_s): charge or change the battery; {PERMIT_AGAIN}"
"""What ends `stopped` while the battery forbids any motion."""

PLANNER_CLEARED_BY: Final = "a drive from that planner, or its goodbye (start it again, and end it)"
"""What ends `stopped` while a planner has the car and asks for nothing, or was lost."""

OWN_LAW_CLEARED_BY: Final = (
    "mend the line of your law that the reason names, and start the car again; a new permit tries the law as it is"
    " (with operator.permit = always time does)"
)
"""What ends a state in which a law of the user has failed."""
OF_AN_OWN_LAW: Final = frozenset({DrivingState.STOPPED, DrivingState.DISARMED, DrivingState.ARMED})


TOO_SLOW: Final = "the motor does not turn below motor.min_speed_mps = {:g} m/s: ask for more"


@value()
class Circumstances:
    """What a decision does not say of itself.

    missing: the device that is not ready, with its message; "" when both are. fault, e_stop: reasons of the latched
        causes, "" when open. permitted: autonomy may move. refusal: the permit's last reason. battery: why the battery
        forbids any motion, "" while it does not. slowest_mps: below it the motor does not turn.
    """

    missing: str
    fault: str
    e_stop: str
    permitted: bool
    refusal: str
    battery: str = ""
    slowest_mps: float = 0.0


def observe(output: Output, around: Circumstances) -> tuple[Observation, str]:
    """Return what is true of a decision, and its reason."""
    decision = output.decision
    if around.fault:
        return Observation.FAULT, around.fault
    if around.e_stop:
        return Observation.ESTOP, around.e_stop
    limited = decision.winner is not decision.driver
    stalls = 0.0 < abs(decision.speed_mps) < around.slowest_mps
    if output.drive.speed_mps and output.delivered and not stalls:
        # Also for the 0.15 s in which the last scan of a lost lidar still counts.
        return (Observation.SLOWED if limited else Observation.FREE), decision.reason
    if around.missing:
        return Observation.DEVICE_MISSING, around.missing
    if around.battery:
        # Before the permit, which an empty battery has taken: a permit alone would not end this stop.
        return Observation.BLOCKED, around.battery
    by_hand = decision.driver is Source.TELEOP
    if not (by_hand or around.permitted):
        return Observation.NOT_PERMITTED, around.refusal
    if stalls:
        return Observation.BLOCKED, TOO_SLOW.format(around.slowest_mps)
    # A human who asks for 0 stops the car himself; so does the limiter while it passes from one gear to the other.
    idle = decision.speed_mps != 0 or (by_hand and not limited)
    return (Observation.IDLE if idle else Observation.BLOCKED), decision.reason


class DrivingStateMonitor:
    """Holds the state from decision to decision.

    battery: returns why the battery forbids any motion, "" while it does not. own_law: returns the fault of a law of
        the user, "" without one. slowest_mps: below it the motor does not turn.
    state, reason: the present ones. measure: the number behind the reason, NaN where there is none. since_s: beginning
        of the state.
    """

    def __init__(
        self,
        lidar: Lidar,
        motor: Motor,
        emergency_stop: EmergencyStop,
        permit: Permit,
        clock: Clock,
        battery: Callable[[], str] = lambda: "",
    ) -> None:
        self._devices = (("motor", motor), ("lidar", lidar))
        self._causes = emergency_stop.causes
        self._permit = permit
        self._clock = clock
        self._battery = battery
        self.own_law: Callable[[], str] = lambda: ""
        self.slowest_mps = 0.0
        self.state = DrivingState.STARTING
        self.reason = "no decision yet"
        self.measure = math.nan
        self.since_s = clock()
        self._winner: Source | None = None

    def update(self, output: Output) -> None:
        """Take in one decision."""
        seen, self.reason = observe(output, self._circumstances())
        self._winner = output.decision.winner
        self.measure = output.decision.measure if self.reason is output.decision.reason else math.nan
        state = STATE_OF[seen]
        if state is not self.state:
            self.state, self.since_s = state, self._clock()

    def fields(self) -> dict[str, str | float]:
        """Return plain values for the status."""
        cleared_by = self._cleared_by()
        return {
            "state": str(self.state),
            "reason": self.reason,
            "measure": self.measure,
            "clears": cleared_by.replace(PERMIT_AGAIN, DRIVES_ON) if self._permit.always else cleared_by,
            "for_s": self._clock() - self.since_s,
        }

    def _cleared_by(self) -> str:
        if self.state is DrivingState.STOPPED:
            if self.reason == self._battery() != "":
                return BATTERY_CLEARED_BY
            if self._winner is Source.PLANNER_HOLD:
                return PLANNER_CLEARED_BY
        if self.state in OF_AN_OWN_LAW and self.own_law():
            return OWN_LAW_CLEARED_BY
        return CLEARED_BY[self.state]

    def _circumstances(self) -> Circumstances:
        causes, permit = self._causes, self._permit
        return Circumstances(
            self._missing(),
            causes.get(Cause.MOTOR, ""),
            causes.get(Cause.OPERATOR, ""),
            permitted=self._clock() < permit.until_s,
            refusal=permit.reason,
            battery=self._battery(),
            slowest_mps=self.slowest_mps,
        )

    def _missing(self) -> str:
        for name, device in self._devices:
            health = device.health
            if health.link is not LinkState.READY:
                return f"{name} {health.link}: {health.message}"
        return ""
