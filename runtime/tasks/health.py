"""Monitoring of the devices and of the process itself: latches faults, requires rearming, notifies systemd."""

import logging
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from wallride.drivers.api import NOT_OPENED, Clock, Health, Lidar, LinkState, Motor
from wallride.runtime.arbitration.command import NO_WINNER, Output
from wallride.runtime.arbitration.emergency_stop import Cause, EmergencyStop
from wallride.runtime.arbitration.obedience import Obedience
from wallride.runtime.host.systemd import ServiceManager

log = logging.getLogger("wallride.health")

RATE_HZ = 20.0
READY_AT_LATEST_S = 10.0
"""Maximum time until systemd receives READY, even without devices: boot must not hang on a cable."""
CYCLE_LIMIT_S = 0.2
"""Maximum age of the mux's last decision for a healthy process; beyond it the watchdog is not notified."""
FAULT_RETRY_S = 2.0
"""Delay before the retry of a motor controller's own fault without an operator (permit "always"); doubled with each
attempt."""
MAX_FAULT_RETRY_S = 60.0
FAULT_FORGOTTEN_S = 30.0
"""Time without a fault after which the next fault is retried after the shortest delay again."""
NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")
AFTER_FAULT = "the motor had a fault; permit again"


@dataclass(slots=True)
class _LastReport:
    """Last report on a device, so that the log has one line per change."""

    link: LinkState = LinkState.ABSENT
    message: str = ""
    identity: str = ""
    lost: str = ""  # reason of its loss, until it is back


@dataclass(slots=True)
class HealthMonitor:
    """Checks everything at RATE_HZ; `check` is one round, so that tests can step through time.

    output: returns the mux's last decision; its age is the evidence on which the watchdog is notified.
    rearm: called with the reason when no button that an operator holds down may count any longer.
    lidar_doubt, motor_doubt: the contradictions in a device's own data (`control.plausibility`), "" without any.
    """

    lidar: Lidar
    motor: Motor
    output: Callable[[], Output | None]
    emergency_stop: EmergencyStop
    rearm: Callable[[str], None]
    manager: ServiceManager
    clock: Clock
    retry_faults: bool
    lidar_doubt: Callable[[], str] = lambda: ""
    motor_doubt: Callable[[], str] = lambda: ""
    obedience: Obedience = field(default_factory=Obedience)
    _lidar_seen: _LastReport = field(default_factory=_LastReport)
    _motor_seen: _LastReport = field(default_factory=_LastReport)
    _doubted: str = ""
    _fault_since_s: float | None = None
    _fault_over_s: float = -math.inf
    _retry_after_s: float = FAULT_RETRY_S
    _started_s: float | None = None
    _ready: bool = False

    def is_waiting(self, by_hand: bool) -> bool:  # noqa: FBT001 - the question of `OperatorDesk.waits`
        """Tell whether a device was lost whose return has not been noticed yet; the lidar is none to a human."""
        return self._motor_seen.lost != "" or (not by_hand and self._lidar_seen.lost != "")

    def tick(self, _late_s: float, _missed: int) -> None:
        """Check once; a `periodic.Tick`. The lateness of the loop is noted by the mux's tick (`StageTimer`)."""
        self.check()

    def check(self) -> None:
        """Check everything once."""
        now_s = self.clock()
        self._look_at("lidar", self.lidar.health, self._lidar_seen)
        self._look_at("motor", self.motor.health, self._motor_seen)
        self._look_for_doubts()
        self._latch_fault(now_s)
        self.obedience.look(self.output(), self.motor.state, now_s)
        self._tell_systemd(now_s)

    def _look_at(self, name: str, health: Health, seen: _LastReport) -> None:
        if seen.link is LinkState.READY and health.link is not LinkState.READY:
            seen.lost = f"{health.trouble or f'the {name} was lost'}; permit again"
            self.rearm(seen.lost)
        elif seen.lost and health.link is LinkState.READY:
            self.rearm(seen.lost)  # again: what was pressed during the outage must not move the car by itself
            seen.lost = ""
        if seen.identity not in {"", health.identity}:
            log.warning("%s: %s, before it was %s", name, health.identity, seen.identity)
            seen.lost = f"another {name} than before; check how it is mounted, permit again"
            self.rearm(seen.lost)
        seen.identity = health.identity
        if (seen.link, _without_numbers(seen.message)) != (health.link, _without_numbers(health.message)):
            is_well = health.link in {LinkState.READY, LinkState.STARTING} or health.message == NOT_OPENED
            level = logging.INFO if is_well else logging.WARNING
            log.log(level, "%s %s: %s", name, health.link, health.message)
        seen.link, seen.message = health.link, health.message

    def _look_for_doubts(self) -> None:
        """Latch a stop for a motor that contradicts the lidar; a lidar that contradicts itself counts as lost."""
        doubt = self.lidar_doubt()
        if doubt != self._doubted:
            if doubt:
                log.error("%s", doubt)
            self.rearm(f"{doubt or self._doubted}; permit again")
            self._doubted = doubt
        if words := self.motor_doubt():
            self.motor.latch_fault(words)

    def _latch_fault(self, now_s: float) -> None:
        state = self.motor.state
        fault = self._fault_words()
        if fault:
            if self._fault_since_s is None:
                self._fault_since_s = now_s
                if now_s - self._fault_over_s > FAULT_FORGOTTEN_S:
                    self._retry_after_s = FAULT_RETRY_S
                log.error("%s", fault)
                self.emergency_stop.latch(Cause.MOTOR, fault)
                self.rearm(AFTER_FAULT)
            elif self.retry_faults and now_s - self._fault_since_s > self._retry_after_s:
                self._fault_since_s = now_s
                self._retry_after_s = min(2 * self._retry_after_s, MAX_FAULT_RETRY_S)
                self.motor.retry_fault()
        elif self._fault_since_s is not None and state is not None:
            self._fault_since_s = None
            self._fault_over_s = now_s
            self.rearm(AFTER_FAULT)
            self.emergency_stop.clear(Cause.MOTOR)

    def _fault_words(self) -> str:
        state = self.motor.state
        if state is None:
            return ""
        if state.killed:
            return "the motor controller's kill switch is on"
        return f"motor fault: {state.fault}" if state.fault else ""

    def _tell_systemd(self, now_s: float) -> None:
        if self._started_s is None:
            self._started_s = now_s
        if not self._ready:
            devices_up = self.lidar.health.link is LinkState.READY and self.motor.health.link is LinkState.READY
            if devices_up or now_s - self._started_s > READY_AT_LATEST_S:
                self._ready = True
                self.manager.ready()
        output = self.output()
        if output is not None and now_s - output.stamp_s < CYCLE_LIMIT_S:
            self.manager.alive()
            self.manager.status(f"{output.decision.winner or NO_WINNER}: {output.decision.reason}")


def _without_numbers(message: str) -> str:
    """Return a message without what counts on in it, such as the time since the last scan: not to be logged again."""
    return NUMBER.sub("#", message)
