"""Present state and next step for the operator, as text. Pure: a situation in, two short texts out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from wallride.clients.teleop.inputs import BUTTONS, Control
from wallride.clients.teleop.pilot import LINK_LOST_S, MINDED_S, PERMIT_SILENT_S, DeadmanFault, PilotState
from wallride.runtime.wire.teleop import CarCondition, Input, Press

PAD_NAMES: Mapping[Control, str] = {
    Control.MANUAL: "LB",
    Control.AUTONOMY: "RB",
    Control.ESTOP: "B",
    Control.RESET: "Start",
    Control.TAKE_OVER: "Y",
    Control.SPEED: "left stick up/down",
    Control.STEERING: "right stick left/right",
}
WARN_SILENT_S = 3.0
STANDING_BELOW_MPS = 0.05


class AdviceLevel(StrEnum):
    """Level of the advice, which sets its colour on the screen."""

    STOPPED = "red"
    WAITING = "yellow"
    MOVING = "green"


@dataclass(frozen=True, slots=True)
class Advice:
    """state: a word or two. next_step: what to do, "" when there is nothing to do."""

    mood: AdviceLevel
    state: str
    next_step: str


def advise(now: PilotState, names: Mapping[Control, str] = PAD_NAMES, *, by_keys: bool = False) -> Advice:
    """Return the advice. names: labels of this device's buttons. by_keys: whether certificates say who may drive."""
    if now.stop_pending:
        link = "" if now.linked else f"; {_link_lost(now)}"
        return Advice(AdviceLevel.STOPPED, "E-STOP", "sending the e-stop until the car confirms it" + link)
    if now.block is not DeadmanFault.NONE:
        return _blocked(now, names, by_keys=by_keys)
    if now.flags in {Press.RESET, Press.TAKE_OVER}:
        return Advice(AdviceLevel.WAITING, "asking the car", "")
    if not now.armed:
        return Advice(AdviceLevel.WAITING, "release first", _release(now, names))
    return _armed(now, names, by_keys=by_keys)


def _blocked(now: PilotState, names: Mapping[Control, str], *, by_keys: bool) -> Advice:
    allowed = ": may this certificate read it?" if by_keys else ""
    release, other = _release(now, names), _other(now, names)
    texts = {
        DeadmanFault.WAITING: ("waiting", f"no heartbeat from the car yet{allowed}"),
        DeadmanFault.LINK: ("LINK LOST", f"{_link_lost(now)}: the car stops by itself; wait, {release}"),
        DeadmanFault.DEVICE: ("NO INPUT", now.inputs.trouble or "no input device"),
        DeadmanFault.FROZEN: ("PAD SILENT", f"no event for {now.input_age_s:.1f} s: is the pad on and near? {release}"),
        DeadmanFault.PAUSED: ("paused", f"this program stood still: {release}"),
        DeadmanFault.RESTARTED: ("car restarted", release),
        DeadmanFault.LATCHED: ("E-STOP", _reset(now, names) if now.mine or not now.operator_name else other[1]),
        DeadmanFault.OTHER: other,
        DeadmanFault.LOST: ("car lost us", f"our commands came too late: {release}"),
        DeadmanFault.REARM: ("release first", release),
    }  # fmt: skip
    state, text = texts.get(now.block, (str(now.block), ""))
    waiting = {
        DeadmanFault.WAITING,
        DeadmanFault.OTHER,
        DeadmanFault.REARM,
        DeadmanFault.PAUSED,
        DeadmanFault.RESTARTED,
    }
    return Advice(AdviceLevel.WAITING if now.block in waiting else AdviceLevel.STOPPED, state, text)


def _other(now: PilotState, names: Mapping[Control, str]) -> tuple[str, str]:
    take_over = f"release everything, then hold {names[Control.TAKE_OVER]} for 1 s to take over{_progress(now)}"
    if now.beat is not None and CarCondition.OPERATOR_LOST in now.beat.flags:
        return f"{now.operator_name} was lost", _stands(now) + take_over
    return f"{now.operator_name} drives", take_over


def _armed(now: PilotState, names: Mapping[Control, str], *, by_keys: bool) -> Advice:
    driving = now.mine and now.flags in {Press.MANUAL, Press.AUTONOMY}
    if now.too_slow and not driving:
        patience_s = now.patience_s if math.isfinite(now.patience_s) else LINK_LOST_S
        text = f"what you see is up to {now.link_s:.1f} s old, and the car obeys nothing older than {patience_s:.1f} s"
        return Advice(AdviceLevel.STOPPED, "LINK SLOW", f"{text}: come nearer, or close other pages")
    if now.unminded_s > MINDED_S:
        why = "has this certificate the operator role?" if by_keys else "`wallride status` says why"
        text = f"the car does not take our commands: {why}"
        return Advice(AdviceLevel.STOPPED, "not obeyed", text)
    if now.flags == Press.MANUAL:
        return Advice(AdviceLevel.MOVING, "DRIVING", _let_go(now, names, Control.MANUAL))
    if now.flags == Press.AUTONOMY:
        if now.inputs.kind is Input.PAD and now.input_age_s > WARN_SILENT_S:
            left_s = max(0.0, PERMIT_SILENT_S - now.input_age_s)
            return Advice(
                AdviceLevel.WAITING, "AUTONOMY", f"move a stick: the permit ends in {left_s:.0f} s, the pad is silent"
            )
        return Advice(AdviceLevel.MOVING, "AUTONOMY", _let_go(now, names, Control.AUTONOMY))
    if now.beat is not None and CarCondition.FAULT in now.beat.flags:
        return Advice(
            AdviceLevel.STOPPED, "motor fault", f"hold {names[Control.RESET]} for 1 s to clear it{_progress(now)}"
        )
    other = (
        "without an operator it drives by itself"
        if now.drives_alone
        else f"{names[Control.AUTONOMY]} to permit autonomy"
    )
    ways_on = f"hold {names[Control.MANUAL]} to drive, {other}"
    return Advice(AdviceLevel.WAITING, "ready", _stands(now) + ways_on)


def _stands(now: PilotState) -> str:
    """Say whether the car moves: "ready" alone leaves open whether it waits for the operator or drives on by itself."""
    if now.beat is None:
        return ""
    if CarCondition.PERMITTED in now.beat.flags:
        return "the car may drive by itself; "
    return "the car stands; " if abs(now.beat.speed_mps) < STANDING_BELOW_MPS else ""


def _let_go(now: PilotState, names: Mapping[Control, str], held: Control) -> str:
    if now.drives_alone:
        return f"release {names[held]}: the car drives on by itself; {names[Control.ESTOP]} stops it"
    return f"release {names[held]} to stop"


def _release(now: PilotState, names: Mapping[Control, str]) -> str:
    """Name the buttons still held, because a stuck button looks like a defect of the car."""
    held = [names[control] for control in BUTTONS if control in now.inputs.pressed]
    if not now.inputs.centred:
        held.append(f"{_sticks(now)} (speed {now.inputs.speed:+.2f}, steering {now.inputs.steering:+.2f})")
    if not held:
        return "release everything, then press again"
    why = f" (centre {_sticks(now)} before pressing)" if now.closed_by is DeadmanFault.OFF_CENTRE else ""
    return f"release everything first: {', '.join(held)}{why}"


def _sticks(now: PilotState) -> str:
    return "the drive pad" if now.inputs.kind is Input.PAGE else "the sticks"


def _reset(now: PilotState, names: Mapping[Control, str]) -> str:
    return f"release everything, then hold {names[Control.RESET]} for 1 s to reset{_progress(now)}"


def _progress(now: PilotState) -> str:
    return f" ({now.progress:.0%})" if now.holding is not None else ""


def _link_lost(now: PilotState) -> str:
    return f"link lost {now.beat_age_s:.1f} s ago" if math.isfinite(now.beat_age_s) else "no heartbeat heard yet"
