"""Stories in virtual time: which presses count, what closes the gate, and that stopping always gets through."""

import math
from dataclasses import replace

import pytest

from tests.clients.teleop.scenes import DEAD, SESSION, Drive, flags, hands
from wallride.clients.teleop.advice import advise
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pilot import DISTRUST, PAD_SILENT_S, PERMIT_SILENT_S, DeadmanFault
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.wire.teleop import UNKNOWN_AGE_MS, Beat, CarCondition, Input, Press

MANUAL, AUTONOMY, ESTOP, RESET, TAKE_OVER = map(Control, ("manual", "autonomy", "estop", "reset", "take_over"))
NOTHING = Press(0)


@pytest.fixture
def car():
    return Drive()


def test_deadman_then_stick_drives_and_release_is_sent_every_cycle(car):
    command = car.drive(speed=0.5)
    assert (command.flags, command.speed_mps, command.session) == (Press.MANUAL, 1.0, SESSION)
    released = car.hold(hands(speed=0.5), 0.2)
    assert flags(released) == {NOTHING}
    assert {command.speed_mps for command in released} == {0.0}
    assert car.situation.wanted_mps == 0
    assert [command.sequence for command in released] == list(range(released[0].sequence, released[0].sequence + 10))


def test_right_bumper_permits_autonomy_and_asks_for_no_speed(car):
    car.hold(hands())
    command = car.hold(hands(AUTONOMY, speed=0.9))[-1]
    assert (command.flags, command.speed_mps, command.steering_rad) == (Press.AUTONOMY, 0.0, 0.0)


def test_a_deadman_held_from_the_start_does_not_count(car):
    assert flags(car.hold(hands(MANUAL), 1.0)) == {NOTHING}
    assert car.situation.block is DeadmanFault.NONE
    assert not car.situation.armed


def test_a_deadman_pressed_with_a_stick_out_of_its_middle_does_not_count_until_released(car):
    car.hold(hands())
    assert flags(car.hold(hands(MANUAL, speed=0.5))) == {NOTHING}
    assert car.situation.closed_by is DeadmanFault.OFF_CENTRE
    assert flags(car.hold(hands(MANUAL))) == {NOTHING}
    assert car.drive().flags == Press.MANUAL


def test_an_axis_that_is_not_to_be_trusted_stops_a_drive(car):
    car.drive()
    assert car.cycle(hands(MANUAL, speed=0.5, steering=math.nan)).flags == DISTRUST
    assert flags(car.hold(hands(MANUAL, speed=0.5))) == {DISTRUST}


def test_commands_echo_the_newest_heartbeat_and_old_ones_do_not_count(car):
    car.hold(hands(), 0.2)
    assert (car.pilot.step(hands(), car.now_s).car_session, car.pilot.step(hands(), car.now_s).beat) == (9, 10)
    for old in (3, 10):
        car.pilot.hear(replace(car.beat, beat=old), car.now_s + 0.25)
    car.now_s += 0.25
    assert car.pilot.step(hands(), car.now_s).beat == 10
    assert not car.situation.linked, "what was heard before is no heartbeat"


@pytest.mark.parametrize("both", [True, False], ids=["both bumpers", "the red button"])
def test_an_e_stop_needs_no_gate_and_is_sent_until_the_car_latched(car, both):
    press = hands(MANUAL, AUTONOMY, speed=1.0) if both else hands(ESTOP)
    assert car.cycle(press).flags == Press.ESTOP
    assert flags(car.hold(hands(), 1.0)) == {Press.ESTOP}
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands(), 0.04)
    assert flags(car.hold(hands())) == {NOTHING}
    assert car.situation.block is DeadmanFault.LATCHED


def test_an_e_stop_pressed_while_the_link_is_lost_is_still_sent_when_it_is_back(car):
    car.drive()
    car.beating = False
    car.hold(hands(), 1.0)
    car.cycle(hands(ESTOP))
    car.hold(hands(), 2.0)
    car.beating = True
    assert flags(car.hold(hands())) == {Press.ESTOP}


def test_an_e_stop_is_not_confirmed_by_a_heartbeat_from_before_it(car):
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands())
    car.beating = False
    car.cycle(hands(ESTOP))
    assert flags(car.hold(hands(), 2.0)) == {Press.ESTOP}


def test_an_e_stop_that_is_not_confirmed_yet_keeps_the_gate_closed(car):
    car.drive()
    car.cycle(hands(ESTOP))
    car.hold(hands())
    assert car.situation.block is DeadmanFault.LATCHED
    assert not car.situation.armed


def test_an_e_stop_is_insisted_on_also_when_the_car_is_latched_already(car):
    car.says(CarCondition.ESTOP_LATCHED, CarCondition.FAULT)
    car.hold(hands())
    car.cycle(hands(ESTOP))
    assert flags(car.hold(hands(), 0.2)) == {Press.ESTOP}


def test_reset_is_one_second_alone_and_ends_when_the_car_did_it(car):
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands())
    assert flags(car.hold(hands(RESET), 0.98)) == {NOTHING}
    assert flags(car.hold(hands(RESET), 0.1)) == {NOTHING, Press.RESET}
    car.says()
    assert flags(car.hold(hands(RESET), 2.0)) == {NOTHING}
    car.says(CarCondition.ESTOP_LATCHED)
    assert flags(car.hold(hands(RESET), 3.0)) == {NOTHING}, "the same press must not undo the next e-stop"


def test_reset_is_not_insisted_on_for_ever(car):
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands())
    sent = [command.flags for command in car.hold(hands(RESET), 5.0)]
    assert sent.count(Press.RESET) <= 52


@pytest.mark.parametrize("also", [hands(RESET, MANUAL), hands(RESET, TAKE_OVER), hands(RESET, speed=0.5)])
def test_reset_with_anything_else_is_none(car, also):
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands())
    assert Press.RESET not in flags(car.hold(also, 3.0))


def test_a_button_that_is_stuck_when_the_pad_returns_resets_nothing(car):
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands())
    car.hold(DEAD)
    assert flags(car.hold(hands(RESET), 3.0)) == {NOTHING}


def test_after_a_deliberate_press_everything_is_released_first(car):
    car.says(CarCondition.FAULT)
    car.hold(hands())
    car.hold(hands(RESET), 1.1)
    assert flags(car.hold(hands(RESET, MANUAL))) == {NOTHING}


def test_take_over_is_shown_deliberate_and_ends_when_the_car_obeys_us(car):
    car.says(operator=5, name="bob")
    car.hold(hands())
    assert flags(car.hold(hands(MANUAL), 1.0)) == {NOTHING}
    assert (car.situation.block, car.situation.operator_name) == (DeadmanFault.OTHER, "bob")
    car.hold(hands())
    assert Press.TAKE_OVER in flags(car.hold(hands(TAKE_OVER), 1.1))
    car.says(CarCondition.REARM, operator=SESSION)
    assert flags(car.hold(hands(TAKE_OVER), 0.1)) == {NOTHING}
    car.says()
    assert car.drive().flags == Press.MANUAL


def test_a_latched_car_of_another_operator_is_taken_over_before_it_is_reset(car):
    car.says(CarCondition.ESTOP_LATCHED, operator=5, name="bob")
    car.hold(hands())
    assert "to take over" in advise(car.situation).next_step
    assert flags(car.hold(hands(RESET), 1.5)) == {NOTHING}
    car.hold(hands())
    assert Press.TAKE_OVER in flags(car.hold(hands(TAKE_OVER), 1.1))
    car.says(CarCondition.ESTOP_LATCHED, operator=SESSION)
    car.hold(hands())
    assert "to reset" in advise(car.situation).next_step
    assert Press.RESET in flags(car.hold(hands(RESET), 1.1))


def test_a_deadman_held_while_another_operates_does_not_set_off_when_that_one_leaves(car):
    car.says(operator=5)
    car.hold(hands())
    car.hold(hands(MANUAL))
    car.says(operator=0)
    assert flags(car.hold(hands(MANUAL), 1.0)) == {NOTHING}


INCIDENTS = {
    "the car lost us": ((CarCondition.OPERATOR_LOST,), DeadmanFault.LOST),
    "the car wants a release": ((CarCondition.REARM,), DeadmanFault.REARM),
    "e-stop by another": ((CarCondition.ESTOP_LATCHED,), DeadmanFault.LATCHED),
}


@pytest.mark.parametrize(("conditions", "block"), INCIDENTS.values(), ids=INCIDENTS)
def test_after_an_incident_the_held_deadman_does_not_count(car, conditions, block):
    car.drive()
    car.says(*conditions, operator=SESSION)
    assert flags(car.hold(hands(MANUAL, speed=0.5))) == {DISTRUST}
    assert car.situation.block is block
    car.says()
    assert flags(car.hold(hands(MANUAL, speed=0.5), 1.0)) == {DISTRUST}
    assert car.drive().flags == Press.MANUAL


def test_somebody_elses_stuck_button_does_not_keep_us_from_driving(car):
    car.says(CarCondition.REARM, operator=0)
    car.hold(hands())
    assert car.hold(hands(MANUAL))[-1].flags == Press.MANUAL


def test_a_car_that_ignores_our_deadman_and_wants_a_release_gets_one(car):
    car.says(CarCondition.REARM, operator=0)
    car.hold(hands())
    assert car.hold(hands(MANUAL), 0.7)[-1].flags == DISTRUST
    assert car.situation.closed_by is DeadmanFault.REARM


def test_link_loss_drops_everything_within_a_quarter_second_and_only_a_release_opens_again(car):
    car.drive()
    car.beating = False
    commands = car.hold(hands(MANUAL, speed=0.5), 0.24)
    assert commands[-1].flags == DISTRUST
    assert car.situation.block is DeadmanFault.LINK
    car.beating = True
    assert flags(car.hold(hands(MANUAL, speed=0.5), 1.0)) == {DISTRUST}
    assert car.drive().flags == Press.MANUAL


def test_a_restarted_car_is_a_new_car(car):
    car.drive()
    car.beat = Beat(car_session=10, beat=0, flags=CarCondition(0))
    assert car.cycle(hands(MANUAL, speed=0.5)).flags == DISTRUST
    assert flags(car.hold(hands(MANUAL, speed=0.5), 1.0)) == {DISTRUST}
    assert car.pilot.step(hands(), car.now_s).car_session == 10


def test_a_program_that_stood_still_starts_from_a_release(car):
    car.drive()
    car.now_s += 3.0
    assert car.cycle(hands(MANUAL, speed=0.5)).flags == DISTRUST
    assert flags(car.hold(hands(MANUAL, speed=0.5), 1.0)) == {DISTRUST}


def test_a_pad_that_is_gone_stops_and_comes_back_released_first(car):
    car.drive()
    assert flags(car.hold(DEAD)) == {DISTRUST}
    assert flags(car.hold(hands(MANUAL, speed=0.5), 1.0)) == {DISTRUST}
    assert car.drive().flags == Press.MANUAL


def test_the_ramp_begins_anew_at_every_press():
    car = Drive(InputShape(max_speed_mps=2.0, deadzone=0.0, expo=0.0, ramp_mps2=1.0))
    car.drive(speed=1.0)
    car.hold(hands(MANUAL, speed=1.0), 1.0)
    car.hold(hands())
    assert car.cycle(hands(MANUAL, speed=0.2)).speed_mps == pytest.approx(0.02)
    car.hold(hands(MANUAL, speed=1.0), 1.0)
    car.hold(hands(speed=1.0), 0.04)
    assert car.situation.wanted_mps == 0


def test_a_pad_lost_by_the_operator_is_no_release_even_with_nothing_held(car):
    car.says(operator=SESSION)
    car.drive()
    car.hold(hands())
    assert flags(car.hold(DEAD)) == {DISTRUST}
    car.says(operator=5)
    assert flags(car.hold(DEAD)) == {NOTHING}


@pytest.mark.parametrize("speed", [0.5, 0.05], ids=["fast", "slow"])
def test_a_frozen_pad_stops_after_a_second(car, speed):
    car.drive(speed)
    car.event_s = car.now_s
    moving = [c for c in car.hold(hands(MANUAL, speed=speed), 3.0) if Press.MANUAL in c.flags]
    assert moving[-1].input_age_ms <= PAD_SILENT_S * 1000
    assert len(moving) == pytest.approx(PAD_SILENT_S / 0.02, abs=1)
    car.event_s = None
    assert flags(car.hold(hands(MANUAL, speed=speed))) == {DISTRUST}, "an event alone is no release"


def test_a_permit_ends_when_the_pad_is_silent_for_long(car):
    car.hold(hands())
    car.hold(hands(AUTONOMY))
    car.event_s = car.now_s
    assert flags(car.hold(hands(AUTONOMY), PERMIT_SILENT_S - 0.1)) == {Press.AUTONOMY}
    assert car.hold(hands(AUTONOMY), 0.2)[-1].flags == DISTRUST
    assert car.hold(hands())[-1].flags == NOTHING


def test_a_held_deadman_without_speed_and_a_keyboard_may_be_silent(car):
    car.hold(hands())
    car.hold(hands(MANUAL))
    car.event_s = car.now_s
    assert flags(car.hold(hands(MANUAL), 5.0)) == {Press.MANUAL}
    keys = Drive()
    keys.hold(hands(kind=Input.KEYBOARD))
    keys.hold(hands(MANUAL, kind=Input.KEYBOARD))
    keys.event_s = keys.now_s
    assert flags(keys.hold(hands(MANUAL, speed=1.0, kind=Input.KEYBOARD), 5.0)) == {Press.MANUAL}


def test_round_trip_is_the_time_since_sending_less_the_time_in_the_car(car):
    command = car.drive()
    sent_s = car.now_s
    beat = replace(car.beat, beat=car.beat.beat + 1, operator_session=SESSION, acknowledged=command.sequence)
    car.pilot.hear(replace(beat, acknowledged_age_ms=20), sent_s + 0.05)
    car.pilot.step(hands(), sent_s + 0.05)
    assert car.situation.round_trip_s == pytest.approx(0.03)


def test_goodbye_holds_nothing_and_every_one_is_a_new_command(car):
    last = car.drive()
    words = [car.pilot.goodbye(Input.PAD) for _ in range(3)]
    assert flags(words) == {Press.GOODBYE}
    assert [word.sequence - last.sequence for word in words] == [1, 2, 3]
    assert {(word.speed_mps, word.beat) for word in words} == {(0.0, last.beat)}


def test_before_the_first_heartbeat_nothing_is_armed_but_an_e_stop_goes_out(car):
    car.beating = False
    command = car.hold(hands(), 1.0)[-1]
    assert (command.flags, command.car_session, command.beat) == (NOTHING, 0, 0)
    assert flags(car.hold(hands(MANUAL))) == {NOTHING}
    assert car.cycle(hands(ESTOP)).flags == Press.ESTOP


def test_the_age_of_an_input_that_never_spoke_is_unknown(car):
    car.event_s = -math.inf
    assert car.cycle(hands()).input_age_ms == UNKNOWN_AGE_MS


def test_before_a_heartbeat_a_car_can_obey_a_stop_alone(car):
    car.beating = False
    assert not car.pilot.is_addressed(car.cycle(hands()))
    assert not car.pilot.is_addressed(car.pilot.goodbye(Input.PAD))
    assert car.pilot.is_addressed(car.cycle(hands(Control.ESTOP)))
    car.beating = True
    assert car.pilot.is_addressed(car.cycle(hands()))
