"""The car at one moment as plain values: the status ("why is it (not) moving?") and the mux's decision.

Read off the hot path, from references to what the tasks own; computes nothing of its own. In the status, a speed of
null is "no limit", a measure of null "no number", and a gate of "" is open.
"""

import math
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from wallride.drivers.api import Clock, Lidar, LinkState, Motor, MotorState
from wallride.drivers.value import value
from wallride.runtime.arbitration.command import (
    NO_WINNER,
    Decision,
    DriveCommand,
    Output,
    QueueEntry,
    Source,
    SpeedLimit,
)
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.score import Score
from wallride.runtime.realtime.stage_timing import StageTimer
from wallride.runtime.teleop.status import OperatorView
from wallride.runtime.wire.teleop import Command, session_text

LATENCIES = 400
NO_WORD = "no word"


@value()
class SourceStatus:
    """Opinion of one source on the drive in question.

    speed_mps: a driver's request; a limiting source's ceiling in the direction of the drive, >= 0, infinity where it
        does not object.
    steering_rad: a driver's request; None for a limiting source.
    """

    speed_mps: float
    steering_rad: float | None
    reason: str
    measure: float = math.nan


def said(word: QueueEntry, decision: Decision | None) -> SourceStatus:
    """Return what an entry requests or allows now.

    A limit that decided is quoted from the decision. Another one is only evaluated for standstill, which is cheap.
    """
    if isinstance(word, DriveCommand):
        return SourceStatus(word.drive.speed_mps, word.drive.steering_rad, word.reason)
    if decision is not None and decision.winner is word.source:
        return SourceStatus(abs(decision.speed_mps), None, decision.reason, decision.measure)
    verdict = word.assessment.ask(0.0, 0.0)
    backward = decision is not None and decision.speed_mps < 0
    return SourceStatus(verdict.reverse_mps if backward else verdict.forward_mps, None, verdict.reason, verdict.measure)


@dataclass(slots=True)
class Latency:
    """Latency of the newest scans from their last byte to the motor command [s], by age and in order."""

    _samples_s: deque[float] = field(default_factory=deque)
    _ordered_s: list[float] = field(default_factory=list)

    def add(self, latency_s: float) -> None:
        """Add one; kept in order, because to sort them all for every status costs more than the other fields."""
        if len(self._samples_s) == LATENCIES:
            del self._ordered_s[bisect_left(self._ordered_s, self._samples_s.popleft())]
        self._samples_s.append(latency_s)
        insort(self._ordered_s, latency_s)

    def fields(self) -> dict[str, float | None]:
        """Return p50, p99 and the maximum in milliseconds; None without samples."""
        ordered = self._ordered_s
        if not ordered:
            return dict.fromkeys(("p50", "p99", "max"))
        p99_s = ordered[min(len(ordered) - 1, math.ceil(0.99 * len(ordered)) - 1)]
        return {
            name: round(value_s * 1000, 3)
            for name, value_s in (("p50", ordered[len(ordered) // 2]), ("p99", p99_s), ("max", ordered[-1]))
        }


@dataclass(frozen=True, slots=True)
class ObservedState:
    """References to the observable objects; nothing here is owned.

    operator: the operator's side, None where there is none. held: its newest command, while it holds.
    planners: those outside the car. window: faults of the lidar window, as text.
    link: the session as plain values. routers: why nothing goes to each, "" while it does.
    seconds_by_winner: the mux's own account. timings: of the hot path's stages.
    recording: state of the recorder. session: this start of the process, as in every heartbeat; 0 where there is none.
    own_parts: the known parts of the car that its lidar sees. hot_path: which functions run compiled, as text.
    condition: the car's state and what clears it. slowest_mps: below it the motor does not turn. battery: its
        judgement. computer: temperature and throttling. pose: the place on the map, empty without one. view: of the
        newest scan.
    """

    car: str
    version: str
    lidar: Lidar
    motor: Motor
    queue: CommandQueue
    clock: Clock
    seconds_by_winner: Mapping[str, float]
    window: Callable[[], Sequence[str]] = tuple
    operator: Callable[[], OperatorView] | None = None
    held: Callable[[], Command | None] = lambda: None
    planners: Callable[[], Mapping[str, Any]] = dict
    link: Callable[[], Mapping[str, Any]] = dict
    routers: Callable[[], Mapping[str, str]] = dict
    timings: StageTimer | None = None
    recording: Callable[[], Mapping[str, Any]] = dict
    own_parts: Callable[[], Mapping[str, Any]] = dict
    session: int = 0
    hot_path: str = ""
    condition: Callable[[], Mapping[str, Any]] = dict
    slowest_mps: float = 0.0
    battery: Callable[[], Mapping[str, Any]] = dict
    computer: Callable[[], Mapping[str, Any]] = dict
    pose: Callable[[], Mapping[str, Any]] = dict
    view: Callable[[], View | None] = lambda: None


@dataclass(slots=True)
class Journey:
    """Statistics that telemetry itself keeps.

    scans: those that the follower answered. heading: what tells that of `pose`, and why it is not the gyro.
    """

    started_s: float
    scans: int = 0
    score: Score = field(default_factory=Score)
    latency: Latency = field(default_factory=Latency)
    pose: OdometryState = field(default_factory=OdometryState)
    heading: str = ""


def status(observed: ObservedState, output: Output | None, journey: Journey) -> dict[str, Any]:
    """Return the answer to "why is it (not) moving"."""
    now_s, motor_state = observed.clock(), observed.motor.state
    decision = output.decision if output is not None else None
    live = {word.source: word for word in observed.queue.live()}
    heard = {source: said(word, decision) for source, word in live.items()}
    closed = gates(observed, heard)
    pose = journey.pose
    return {
        "car": observed.car,
        "version": observed.version,
        "session": session_text(observed.session),
        "hot_path": observed.hot_path,
        "stamp_s": now_s,
        "up_s": now_s - journey.started_s,
        "state": state(output, closed, observed.slowest_mps),
        "condition": dict(observed.condition()),
        "output": decision_fields(output, live) if output is not None else None,
        "gates": closed,
        "voices": entries(observed, live, heard),
        "operator": observed.operator().fields() if observed.operator is not None else None,
        "planners": dict(observed.planners()),
        "overruled": overruled(observed, live, decision),
        "seconds_by_winner": dict(observed.seconds_by_winner),
        "speed_mps": motor_state.speed_mps if motor_state is not None else None,
        "battery": battery_fields(observed, motor_state),
        "computer": dict(observed.computer()),
        "fault": motor_state.fault if motor_state is not None else "",
        "lidar": health_fields(observed.lidar),
        "window": list(observed.window()),
        "own_parts": dict(observed.own_parts()),
        "motor": health_fields(observed.motor),
        "link": dict(observed.link()),
        "routers": dict(observed.routers()),
        "recording": dict(observed.recording()),
        "scans": journey.scans,
        "scan_to_motor_ms": journey.latency.fields(),
        "timings_us": observed.timings.fields() if observed.timings is not None else None,
        "distance_error": {"mean_abs_m": journey.score.mean_abs_m, "rms_m": journey.score.rms_m},
        "pose": dict(observed.pose()),
        "odom": {"x_m": pose.x_m, "y_m": pose.y_m, "yaw_rad": pose.yaw_rad, "heading": journey.heading},
    }


def battery_fields(observed: ObservedState, state: MotorState | None) -> dict[str, Any] | None:
    """Return the battery; None without a report of the motor controller."""
    if state is None:
        return None
    return {"voltage_v": state.voltage_v, "current_a": state.input_current_a, **observed.battery()}


def state(output: Output | None, closed: Mapping[str, str], slowest_mps: float = 0.0) -> str:
    """Return the car's state in a word or two, for lists of cars."""
    for device in ("motor", "lidar"):
        if closed[device]:
            return f"no {device}"
    if closed[Source.ESTOP]:
        return "e-stop"
    if output is None:
        return "starting"
    speed_mps = abs(output.drive.speed_mps)
    return "driving" if speed_mps and speed_mps >= slowest_mps else "standing"


def gates(observed: ObservedState, heard: Mapping[Source, SourceStatus]) -> dict[str, str]:
    """Return the conditions for autonomy to move, each with the reason why it is not met, "" where it is."""
    closed = {
        name: "" if device.health.link is LinkState.READY else f"{device.health.link}: {device.health.message}"
        for name, device in (("lidar", observed.lidar), ("motor", observed.motor))
    }
    for source in (Source.ESTOP, Source.BATTERY, Source.SAFETY, Source.PERMIT):
        if (says := heard.get(source)) is not None:
            closed[str(source)] = says.reason if says.speed_mps <= 0 else ""
        else:
            closed[str(source)] = "" if source in {Source.ESTOP, Source.BATTERY} else NO_WORD
    wish = heard.get(Source.NAVIGATION)  # a law with a fault asks to stand, with the fault as its reason
    closed[str(Source.NAVIGATION)] = NO_WORD if wish is None else "" if wish.speed_mps else wish.reason
    return closed


def overruled(
    observed: ObservedState, live: Mapping[Source, QueueEntry], decision: Decision | None
) -> dict[str, float | str] | None:
    """Return safety's verdict on a human's command that it does not bind; None where it binds or does not object.

    speed_mps: maximum speed that safety would allow. reason, measure: as of a verdict.
    """
    order, safety, wish = observed.queue.order, live.get(Source.SAFETY), live.get(Source.TELEOP)
    driving = decision is not None and decision.driver is Source.TELEOP
    if not driving or not isinstance(wish, DriveCommand) or not isinstance(safety, SpeedLimit):
        return None
    if order.index(Source.SAFETY) < order.index(Source.TELEOP) or not wish.drive.speed_mps:
        return None
    verdict = safety.assessment.ask(wish.drive.speed_mps, wish.drive.steering_rad)
    most_mps = verdict.forward_mps if wish.drive.speed_mps > 0 else verdict.reverse_mps
    if most_mps >= abs(wish.drive.speed_mps):
        return None
    return {"speed_mps": most_mps, "reason": verdict.reason, "measure": verdict.measure}


def entries(
    observed: ObservedState, live: Mapping[Source, QueueEntry], heard: Mapping[Source, SourceStatus]
) -> dict[str, Any]:
    """Return every source in the mux's order: its age, whether it is in force, and what it requests or allows."""
    ages_s = observed.queue.ages_s()
    return {str(source): _voice(live.get(source), ages_s.get(source), heard) for source in observed.queue.order}


def decision_fields(output: Output, live: Mapping[Source, QueueEntry]) -> dict[str, Any]:
    """Return one decision: the request, the deciding source, the reason, and the command sent to the motor.

    asked_mps: the driver's request. allowed_mps: after the speed limits. speed_mps, steering_rad: after the limiter, as
        sent.
    """
    decision = output.decision
    word = live.get(decision.driver) if decision.driver is not None else None
    return {
        "stamp_s": output.stamp_s,
        "winner": str(decision.winner or NO_WINNER),
        "driver": str(decision.driver) if decision.driver is not None else None,
        "reason": decision.reason,
        "measure": decision.measure,
        "asked_mps": word.drive.speed_mps if isinstance(word, DriveCommand) else None,
        "allowed_mps": decision.speed_mps,
        "speed_mps": output.drive.speed_mps,
        "steering_rad": output.drive.steering_rad,
        "delivered": output.delivered,
    }


def decision(observed: ObservedState, output: Output) -> dict[str, Any]:
    """Return the message `decision`: the fields, and the age of each source."""
    live = {word.source: word for word in observed.queue.live()}
    ages_s = {str(source): age_s for source, age_s in observed.queue.ages_s().items()}
    return {**decision_fields(output, live), "voices_age_s": ages_s}


def health_fields(device: Lidar | Motor) -> dict[str, Any]:
    """Return a device's condition."""
    health = device.health
    return {
        "link": str(health.link),
        "message": health.message,
        "identity": health.identity,
        "counts": dict(health.counts),
    }


def _voice(word: QueueEntry | None, age_s: float | None, heard: Mapping[Source, SourceStatus]) -> dict[str, Any]:
    if word is None:
        return {"age_s": age_s, "live": False}
    says = heard[word.source]
    fields = {
        "age_s": age_s,
        "live": True,
        "caps": isinstance(word, SpeedLimit),
        "speed_mps": says.speed_mps,
        "reason": says.reason,
        "measure": says.measure,
    }
    if says.steering_rad is not None:
        fields["steering_rad"] = says.steering_rad
    return fields
