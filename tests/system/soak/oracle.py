"""Judges every motor command on the wire by what the documentation promises, and by nothing of the car's code.

Sources: docs/architecture.md ("What stops the car, and where", expiry), docs/faults.md (bounds), docs/laws.md and
docs/decisions/0008-teleop-protocol.md (what an operator's press counts for). The oracle sees bytes on the motor's
wire, what the operator and the lidar sent, and which fault is injected; inside one process also safety's answers and
the car's state. Every rule is a necessary condition: a command that breaks one is a violation in any case.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

SET_CURRENT_BRAKE, SET_RPM, SET_SERVO_POS = 7, 8, 12
OTHER_MOTOR_COMMANDS: Final = frozenset({5, 6, 9, 10, 84, 85, 86})
"""Duty, current, position, handbrake and the relative ones: no driver of a car that stops sends them."""
MANUAL, AUTONOMY, ESTOP, RESET = 1, 2, 4, 8
ERPM_PER_MPS: Final = 4614.0
SERVO_PER_RAD: Final = 1.2135
SERVO_AHEAD: Final = 0.5304
MIN_MPS: Final = 0.2
GRAVITY_MPS2: Final = 9.81
BRAKE_MPS2_PER_A: Final = 0.17
MAX_KEPT: Final = 50


@dataclass(frozen=True)
class Promises:
    """Times [s], speeds [m/s] and angles [rad] that the car's settings and documents promise.

    obeyed_s: from an operator's act to the wire. lease_s: life of a press after the beat it echoes. tick_s: time in
    which silence is noticed. scan_s: life of a scan. silence_s: longest time without a motor command.
    slack_s: for what this process itself measures late.
    """

    obeyed_s: float = 1e-6
    lease_s: float = 0.2
    tick_s: float = 0.03
    scan_s: float = 0.15
    silence_s: float = 0.06
    slack_s: float = 1e-6
    auto_mps: float = 1.5
    max_mps: float = 4.0
    max_reverse_mps: float = 1.0
    acceleration_mps2: float = 4.0
    steering_rad: float = 0.34
    steering_radps: float = 3.2
    stuck_s: float = 120.0


@dataclass
class Prohibition:
    """No motion faster than max_mps later than bound_s after since_s. by_hand: also while a human drives."""

    since_s: float
    bound_s: float
    max_mps: float = 0.0
    by_hand: bool = True


@dataclass
class Judged:
    """One answer of safety. at_s: when it was given; wish_mps: to what; forward_mps, reverse_mps: what it allowed."""

    at_s: float
    scan_stamp_s: float
    wish_mps: float
    forward_mps: float
    reverse_mps: float


@dataclass
class Oracle:
    """Feed it with `motor`, `delivered`, `beat`, `scan` ... in the order of their times; `violations` has the verdict.

    newest_scan_s: returns when the newest scan that reached the wire whole was measured.
    knows_safety: safety's answers are passed to `judged`. state: returns the car's state in its own word, and since
    when. late_s: what this process itself is late. ending: the car was asked to stop. context: returns words for the
    record of a violation.
    """

    promises: Promises
    newest_scan_s: Callable[[], float]
    knows_safety: bool = False
    state: Callable[[], tuple[str, float]] | None = None
    violations: Counter[str] = field(default_factory=Counter)
    kept: list[str] = field(default_factory=list)
    commands: int = 0
    moving: int = 0
    last_moved_s: float = -math.inf
    late_s: float = 0.0
    ending: bool = False
    context: Callable[[], str] = lambda: ""
    _prohibited: dict[str, Prohibition] = field(default_factory=dict)
    _beats: dict[int, float] = field(default_factory=dict)
    _armed: bool = False
    _may_reset: bool = False
    _reset_s: float = -math.inf
    _hold: int = 0
    _hold_mps: float = 0.0
    _held_s: float = -math.inf
    _let_go: set[str] = field(default_factory=set)
    _fresh_until_s: float = -math.inf
    _last_s: float = math.inf
    _last_mps: float = 0.0
    _rolls_mps: float = 0.0
    _rolls_s: float = -math.inf
    _servo: float = SERVO_AHEAD
    _servo_s: float = -math.inf
    _judged: list[Judged] = field(default_factory=list)
    _assessed_s: float = -math.inf
    _assessed_at_s: float = -math.inf

    def __post_init__(self) -> None:
        self._drop("no operator has pressed anything", -math.inf, 0.0)

    # What is forbidden, and since when.

    def forbid(
        self, name: str, since_s: float, bound_s: float = 0.0, max_mps: float = 0.0, *, by_hand: bool = True
    ) -> None:
        """Forbid motion from bound_s after since_s on, until `allow`."""
        self._prohibited.setdefault(name, Prohibition(since_s, bound_s, max_mps, by_hand))

    def allow(self, name: str) -> None:
        """End a prohibition."""
        self._prohibited.pop(name, None)

    def fault_shown(self, now_s: float, bound_s: float) -> None:
        """Note that the motor controller has shown a fault: it is latched until a reset.

        Not one that is shown while a reset is on its way: that may reach the car later than the report, and clear it.
        """
        if now_s > self._reset_s + self.promises.obeyed_s + self.late_s:
            self.forbid("fault latched", now_s, bound_s)

    def disarm(self, name: str, since_s: float, bound_s: float = 0.0) -> None:
        """Forbid motion until an operator releases everything and presses again; a reset may come before."""
        self._armed = False
        self._drop(name, since_s, bound_s)

    def blocked(self, now_s: float, for_s: float) -> None:
        """Note that the car's process could do nothing for a time that ends now."""
        if math.isfinite(self._last_s):
            self._last_s = now_s
        for each in self._prohibited.values():
            each.bound_s += for_s + 0.05

    # The operator.

    def beat(self, now_s: float, number: int) -> None:
        """Note that the car sent a heartbeat."""
        self._beats[number] = now_s
        self._beats.pop(number - 600, None)

    def delivered(self, now_s: float, flags: int, echo: int, speed_mps: float = 0.0) -> None:
        """Note that an operator's command reached the car."""
        if flags & ESTOP or flags & 3 == 3:
            self._armed = self._may_reset = False
            self.forbid("e-stop", now_s, self.promises.obeyed_s)
            self._drop("e-stop pressed", now_s, self.promises.obeyed_s)
        sent_s = self._beats.get(echo, -math.inf)
        if now_s >= sent_s + self.promises.lease_s + self.promises.slack_s:
            return  # too old to count, except for a stop
        if now_s >= self._fresh_until_s + self.promises.slack_s:
            self._armed = self._may_reset = False
        self._fresh_until_s = max(self._fresh_until_s, sent_s + self.promises.lease_s)
        self._obey(now_s, flags, speed_mps)

    def _obey(self, now_s: float, flags: int, speed_mps: float) -> None:
        if flags == 0:
            self._armed = self._may_reset = True
            self._drop("released", now_s, self.promises.obeyed_s)
        elif flags == RESET and self._may_reset:
            self._armed = self._may_reset = False
            self._reset_s = now_s
            for name in ("e-stop", "fault latched"):
                self.allow(name)
            self._drop("reset", now_s, self.promises.obeyed_s)
        elif flags in {MANUAL, AUTONOMY} and self._armed and "e-stop" not in self._prohibited:
            if self._hold != flags:
                self._held_s = now_s
            self._hold, self._hold_mps = flags, abs(speed_mps)
            for name in self._let_go:
                self.allow(name)
            self._let_go.clear()
        elif flags not in {MANUAL, AUTONOMY}:
            self._armed = self._may_reset = False
            self._drop("unsure", now_s, self.promises.obeyed_s)

    def _drop(self, name: str, since_s: float, bound_s: float) -> None:
        self._let_go.add(name)
        self.forbid(name, since_s, bound_s)

    # Safety.

    def assessed(self, at_s: float, scan_stamp_s: float) -> None:
        """Note that safety has taken in a scan."""
        self._assessed_s, self._assessed_at_s = scan_stamp_s, at_s

    def judged(self, answer: Judged) -> None:
        """Note what safety allowed for one drive on its newest scan."""
        self._judged = [earlier for earlier in self._judged if earlier.at_s == answer.at_s]
        self._judged.append(answer)

    # The motor's wire.

    def motor(self, at_s: float, payload: bytes) -> None:
        """Judge one payload that arrived at the motor controller."""
        kind = payload[0]
        if kind in OTHER_MOTOR_COMMANDS:
            self._break("a motor command that is neither speed nor brake", at_s, f"kind {kind}")
        if kind == SET_SERVO_POS:
            self._judge_steering(at_s, int.from_bytes(payload[1:3], "big", signed=True) / 1000)
        if kind not in {SET_RPM, SET_CURRENT_BRAKE}:
            return
        self.commands += 1
        value = int.from_bytes(payload[1:5], "big", signed=True)
        speed_mps = value / ERPM_PER_MPS if kind == SET_RPM else 0.0
        brake_a = value / 1000 if kind == SET_CURRENT_BRAKE else 0.0
        if at_s - self._last_s > self.promises.silence_s + self.late_s:
            self._break("silence on the motor's wire", at_s, f"{at_s - self._last_s:.3f} s")
        if kind == SET_RPM and not value:
            self._break("a stop that does not brake", at_s, "speed 0")
        self._judge_change(at_s, speed_mps, brake_a)
        if speed_mps:
            self.moving += 1
            self.last_moved_s = at_s
            self._judge_motion(at_s, speed_mps)
        self._last_s, self._last_mps = at_s, speed_mps

    def opened(self) -> None:
        """Note a new port, or one heard again: silence before is none, and the last word is unknown."""
        self._last_s, self._last_mps = math.inf, 0.0

    def hung_up(self, now_s: float) -> None:
        """Note that the car closed the motor's port: its last word must be a brake."""
        if self._last_mps:
            self._break("the last word on a connection is no brake", now_s, f"{self._last_mps:.2f} m/s")
        self._last_mps = 0.0
        self._last_s = math.inf

    def _judge_motion(self, at_s: float, speed_mps: float) -> None:
        slack_s = self.promises.slack_s + self.late_s
        for name, each in self._prohibited.items():
            if self._hold == MANUAL and not each.by_hand:
                continue
            if abs(speed_mps) > each.max_mps * 1.001 and at_s > each.since_s + each.bound_s + slack_s:
                self._break(name, at_s, f"{speed_mps:.2f} m/s {at_s - each.since_s:.3f} s after")
        if at_s > self._fresh_until_s + self.promises.tick_s + slack_s:
            self._break("no fresh press", at_s, f"expired {at_s - self._fresh_until_s:.3f} s ago")
        limit_mps = self.promises.max_mps if speed_mps > 0 else self.promises.max_reverse_mps
        has_changed = at_s <= self._held_s + self.promises.obeyed_s + self.late_s
        if self._hold == AUTONOMY and not has_changed:
            limit_mps = min(limit_mps, self.promises.auto_mps)
            self._judge_autonomy(at_s, speed_mps, slack_s)
        elif self._hold == MANUAL and not has_changed:
            limit_mps = min(limit_mps, self._hold_mps)
        if abs(speed_mps) > limit_mps * 1.001:
            self._break("faster than asked or allowed", at_s, f"{speed_mps:.2f} m/s, at most {limit_mps:.2f}")
        if self.state is not None:
            state, since_s = self.state()
            if state not in {"driving", "limited"} and since_s < at_s - slack_s:
                self._break("motion in a state that does not move", at_s, state)

    def _judge_autonomy(self, at_s: float, speed_mps: float, slack_s: float) -> None:
        age_s = at_s - self.newest_scan_s()
        if age_s > self.promises.scan_s + self.promises.tick_s + slack_s:
            self._break("no fresh scan", at_s, f"{age_s:.3f} s old")
        if not self.knows_safety:
            return
        if at_s - self._assessed_s > self.promises.scan_s + self.promises.tick_s + slack_s:
            self._break("safety has judged no fresh scan", at_s, f"{at_s - self._assessed_s:.3f} s old")
        # What was written and what safety learnt in the same instant may be read in either order.
        is_new = at_s <= self._assessed_at_s + slack_s
        answers = [
            answer for answer in self._judged
            if answer.at_s >= at_s - slack_s and (is_new or answer.scan_stamp_s == self._assessed_s)
        ]  # fmt: skip
        if not answers:
            self._break("safety was not asked", at_s, f"{speed_mps:.2f} m/s")
        elif not any(-each.reverse_mps - 1e-3 <= speed_mps <= each.forward_mps + 1e-3 for each in answers):
            allowed = f"-{answers[-1].reverse_mps:.2f} to {answers[-1].forward_mps:.2f}"
            self._break("more than safety allowed", at_s, f"{speed_mps:.2f} m/s of {allowed}")

    def _judge_change(self, at_s: float, speed_mps: float, brake_a: float) -> None:
        """The speed rises at a limited rate, also from what a brake has left, and changes its sign through a stop."""
        dt_s = at_s - self._rolls_s if math.isfinite(self._rolls_s) else 1.0
        left_mps = max(0.0, abs(self._rolls_mps) - self._loss_mps2 * dt_s)
        if speed_mps * self._rolls_mps < 0 and left_mps and self._last_mps:
            self._break("turned round without a stop", at_s, f"{self._rolls_mps:.2f} to {speed_mps:.2f} m/s")
        # A speed that the controller cannot hold goes out as a brake, but counts as one to rise from.
        most_mps = (
            max(left_mps, MIN_MPS)
            + self.promises.acceleration_mps2 * (dt_s + self.promises.slack_s + self.late_s)
            + 0.01
        )
        if abs(speed_mps) > most_mps:
            self._break("faster than it may rise", at_s, f"{speed_mps:.2f} m/s, at most {most_mps:.2f}")
        self._rolls_s = at_s
        self._rolls_mps = speed_mps or math.copysign(left_mps, self._rolls_mps)
        self._loss_mps2 = min(brake_a * BRAKE_MPS2_PER_A, GRAVITY_MPS2)

    _loss_mps2: float = 0.0

    def _judge_steering(self, at_s: float, servo: float) -> None:
        angle_rad = abs(servo - SERVO_AHEAD) / SERVO_PER_RAD
        if angle_rad > self.promises.steering_rad + 0.002:
            self._break("steers beyond the limit", at_s, f"{angle_rad:.3f} rad")
        dt_s = at_s - self._servo_s if math.isfinite(self._servo_s) else 1.0
        step_rad = abs(servo - self._servo) / SERVO_PER_RAD
        # At its end the car holds the steering of the last report, which may be a tick old.
        if (
            not self.ending
            and step_rad > self.promises.steering_radps * (dt_s + self.promises.slack_s + self.late_s) + 0.004
        ):
            self._break("steers faster than the servo can", at_s, f"{step_rad:.3f} rad in {dt_s:.3f} s")
        self._servo, self._servo_s = servo, at_s

    def idle(self, now_s: float) -> None:
        """Check what can only be missing: motion at some time."""
        if now_s - max(self.last_moved_s, 0.0) > self.promises.stuck_s:
            self._break("stuck", now_s, f"no motion for {self.promises.stuck_s:g} s")
            self.last_moved_s = now_s

    def _break(self, rule: str, at_s: float, what: str) -> None:
        self.violations[rule] += 1
        if len(self.kept) < MAX_KEPT:
            self.kept.append(f"{at_s:10.3f} s  {rule}: {what}  {self.context()}".rstrip())
