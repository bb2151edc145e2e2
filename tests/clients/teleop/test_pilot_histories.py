"""Whatever the hands, the link and the car do: MANUAL goes out only for a deadman that is held now and began centred.

The oracle is a second, simpler bookkeeping: it goes back through the whole history instead of keeping a state.
"""

import math
from dataclasses import dataclass, replace

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.clients.teleop.scenes import LINEAR, SESSION
from wallride.clients.teleop.inputs import BUTTONS, Control, Inputs
from wallride.clients.teleop.pilot import DISTRUST, LINK_LOST_S, PAD_SILENT_S, PAUSE_S, Pilot
from wallride.runtime.wire.teleop import Beat, CarCondition, Input, Press

NOTHING = Press(0)
STICKS = st.sampled_from([0.0, 0.0, 0.0, 0.1, 0.5, -0.9, 1.0, math.nan])
HANDS = st.builds(
    lambda live, pressed, speed, steering: Inputs(
        Input.PAD, live=live, pressed=frozenset(pressed), speed=speed, steering=steering
    ),
    st.sampled_from([True, True, True, True, False]),
    st.one_of(st.just(()), st.just((Control.MANUAL,)), st.sets(st.sampled_from(BUTTONS), max_size=3)),
    STICKS,
    STICKS,
)


@dataclass(frozen=True)
class Stretch:
    """Some cycles in which nothing changes."""

    inputs: Inputs
    cycles: int
    late_s: float
    beating: bool
    silent: bool
    conditions: CarCondition
    operator: int
    car_session: int


STRETCHES = st.lists(
    st.builds(
        Stretch,
        inputs=HANDS,
        cycles=st.integers(1, 60),
        late_s=st.sampled_from([0.0, 0.0, 0.0, 0.5]),
        beating=st.sampled_from([True, True, True, False]),
        silent=st.sampled_from([False, False, True]),
        conditions=st.sampled_from([CarCondition(0)] * 4 + list(CarCondition)),
        operator=st.sampled_from([0, SESSION, SESSION, 5]),
        car_session=st.sampled_from([1, 1, 1, 2]),
    ),
    max_size=12,
)


@dataclass(frozen=True)
class Moment:
    inputs: Inputs
    now_s: float
    beat_age_s: float
    beat: Beat | None
    elapsed_s: float
    sent: Press = NOTHING


def may_drive(history: list[Moment]) -> bool:
    """Go back from now: the deadman was held without a flaw until a press with centred sticks after a full release."""
    for at in range(len(history) - 1, -1, -1):
        moment = history[at]
        inputs = moment.inputs
        if not is_well(moment):
            return False
        if inputs.released:
            return at + 1 < len(history) and history[at + 1].inputs.centred
        if Control.MANUAL not in inputs.pressed:
            # Something else is touched: fine, as long as all of it was well since the last full release.
            return (at + 1 < len(history) and history[at + 1].inputs.centred) and armed_before(history[: at + 1])
    return False


def armed_before(history: list[Moment]) -> bool:
    for moment in reversed(history):
        if not is_well(moment):
            return False
        if moment.inputs.released:
            return True
    return False


def owes_release(history: list[Moment]) -> bool:
    """Whether the deadman is held without a break since a moment at which it counted."""
    for at in range(len(history) - 1, -1, -1):
        if history[at].sent in {Press.MANUAL, Press.AUTONOMY}:
            return True
        if not history[at].inputs.live or history[at].inputs.pressed & {Control.MANUAL, Control.AUTONOMY} == set():
            return False
    return False


def is_well(moment: Moment) -> bool:
    inputs, beat = moment.inputs, moment.beat
    if beat is None or not inputs.live or moment.beat_age_s > LINK_LOST_S or moment.elapsed_s > PAUSE_S:
        return False
    if inputs.wants_stop or CarCondition.ESTOP_LATCHED in beat.flags or beat.operator_session not in {0, SESSION}:
        return False
    if beat.operator_session == SESSION and beat.flags & (CarCondition.OPERATOR_LOST | CarCondition.REARM):
        return False
    moving = Control.MANUAL in inputs.pressed and inputs.speed != 0
    return inputs.sound and not (moving and moment.now_s - inputs.event_s > PAD_SILENT_S + 1e-9)


@settings(max_examples=200, deadline=None)
@given(stretches=STRETCHES)
def test_manual_is_never_sent_without_a_deadman_that_began_centred(stretches):
    pilot = Pilot(SESSION, "ann", LINEAR)
    now_s, last_s, beat, beat_s, event_s, number = 10.0, 10.0, None, -math.inf, 10.0, 0
    history: list[Moment] = []
    for stretch in stretches:
        now_s += stretch.late_s
        for _ in range(stretch.cycles):
            now_s += 0.02
            if stretch.beating:
                number += 1
                beat = Beat(stretch.car_session, number, stretch.conditions, stretch.operator)
                beat_s = now_s
                pilot.hear(beat, now_s)
            event_s = event_s if stretch.silent else now_s
            inputs = replace(stretch.inputs, event_s=event_s)
            command = pilot.step(inputs, now_s)
            history.append(Moment(inputs, now_s, now_s - beat_s, beat, now_s - last_s))
            last_s = now_s
            check(command.flags, command.speed_mps, inputs, history)
            history[-1] = replace(history[-1], sent=command.flags)
    assert pilot.goodbye(Input.PAD).flags == Press.GOODBYE


def check(flags: Press, speed_mps: float, inputs: Inputs, history: list[Moment]) -> None:
    assert flags in {Press(0), DISTRUST, *(press for press in Press if press is not Press.GOODBYE)}
    assert math.isfinite(speed_mps)
    assert flags == Press.MANUAL or speed_mps == 0
    if not flags:
        assert not owes_release(history), "a release that nobody saw"
    if inputs.wants_stop:
        assert flags == Press.ESTOP
    if Press.MANUAL in flags:
        assert inputs.live
        assert Control.MANUAL in inputs.pressed
        assert may_drive(history)
    if flags == Press.AUTONOMY:
        assert inputs.live
        assert Control.AUTONOMY in inputs.pressed
        assert armed_before(history[:-1])
    if flags == Press.RESET:
        assert {moment.inputs.pressed for moment in history[-45:]} == {frozenset({Control.RESET})}
    if Press.TAKE_OVER in flags:
        assert {moment.inputs.pressed for moment in history[-45:]} == {frozenset({Control.TAKE_OVER})}
