"""The words on the screen: every situation has a next step, and the car's own reasons are shown."""

import io
import json
import math
from dataclasses import replace

import pytest

from tests.clients.teleop.scenes import DEAD, SESSION, Drive, hands
from wallride.clients.teleop.advice import advise
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.keyboard import HELD_NAMES
from wallride.clients.teleop.screen import CarState, Screen, lines
from wallride.runtime.wire.teleop import CarCondition, Input


def waiting(car):
    car.beating = False
    car.hold(hands())


def lost_link(car):
    car.drive()
    car.beating = False
    car.hold(hands(Control.MANUAL), 0.4)


def frozen(car):
    car.drive()
    car.event_s = car.now_s
    car.hold(hands(Control.MANUAL, speed=0.5), 1.4)


def quiet_permit(car):
    car.says(operator=SESSION)
    car.hold(hands())
    car.hold(hands(Control.AUTONOMY))
    car.event_s = car.now_s
    car.hold(hands(Control.AUTONOMY), 3.5)


def other(car):
    car.says(operator=5, name="bob")
    car.hold(hands(), 0.1)
    car.hold(hands(Control.TAKE_OVER), 0.52)


def latched(car):
    car.says(CarCondition.ESTOP_LATCHED)
    car.hold(hands())


def fault(car):
    car.says(CarCondition.FAULT)
    car.hold(hands())


def ignored(car):
    car.says(operator=0)
    car.hold(hands())
    car.hold(hands(Control.MANUAL), 1.0)


def off_centre(car):
    car.hold(hands())
    car.hold(hands(Control.MANUAL, speed=0.5))


def driving(car):
    car.says(operator=SESSION)
    car.drive()


def stands(car, *conditions, operator=0, name=""):
    car.beat = replace(car.beat, speed_mps=0.0)
    car.says(*conditions, operator=operator, name=name)
    car.hold(hands())


def off_centre_on_a_page(car):
    car.hold(hands(kind=Input.PAGE))
    car.hold(hands(Control.MANUAL, speed=0.5, kind=Input.PAGE))


LOST = CarCondition.OPERATOR_LOST
STORIES = [
    (waiting, "waiting", "no heartbeat"),
    (lambda car: car.hold(hands()), "ready", "hold LB to drive, RB to permit autonomy"),
    (stands, "ready", "the car stands; hold LB to drive"),
    (lambda car: stands(car, CarCondition.PERMITTED), "ready", "the car may drive by itself; hold LB to drive"),
    (lambda car: stands(car, LOST, operator=5, name="bob"), "bob was lost", "the car stands; release everything, then"),
    (off_centre_on_a_page, "release first", "centre the drive pad before pressing"),
    (lambda car: car.hold(hands(Control.MANUAL)), "release first", "release everything first: LB"),
    (off_centre, "release first", "centre the sticks before pressing"),
    (driving, "DRIVING", "release LB to stop"),
    (lambda car: (car.hold(hands()), car.hold(hands(Control.AUTONOMY))), "AUTONOMY", "release RB to stop"),
    (lost_link, "LINK LOST", "link lost 0.4 s ago"),
    (lambda car: car.hold(DEAD), "NO INPUT", "unplugged"),
    (frozen, "PAD SILENT", "no event for 1.4 s"),
    (quiet_permit, "AUTONOMY", "move a stick: the permit ends in 2 s"),
    (other, "bob drives", "hold Y for 1 s to take over (50%)"),
    (latched, "E-STOP", "hold Start for 1 s to reset"),
    (lambda car: car.hold(hands(Control.ESTOP)), "E-STOP", "until the car confirms it"),
    (fault, "motor fault", "hold Start"),
    (ignored, "not obeyed", "`wallride status` says why"),
]  # fmt: skip


@pytest.mark.parametrize(("story", "state", "words"), STORIES, ids=[words for _, _, words in STORIES])
def test_what_to_do_next(story, state, words):
    car = Drive()
    story(car)
    advice = advise(car.situation)
    assert advice.state == state
    assert words in advice.next_step


def test_only_over_tls_a_certificate_may_be_the_reason():
    for story, words in ((waiting, "may this certificate read it?"), (ignored, "has this certificate the operator")):
        story(car := Drive())
        assert words in advise(car.situation, by_keys=True).next_step
        assert "certificate" not in advise(car.situation).next_step


def test_a_lost_link_is_said_within_0_3_s():
    """Heartbeats stop; the screen is drawn at every third cycle of 0.02 s at the latest."""
    car = Drive()
    car.drive()
    car.beating = False
    last_beat_s = car.now_s
    while advise(car.situation).state != "LINK LOST":
        car.cycle(hands())
    assert car.now_s - last_beat_s + 3 * 0.02 <= 0.3


def test_the_screen_says_why_the_car_does_not_move():
    car, news = Drive(), CarState()
    driving(car)
    status = {"output": {"winner": "safety", "reason": "wall ahead", "measure": 0.61}, "voltage_v": 7.9, "fault": "hot"}
    news.take(json.dumps(status).encode())
    for session in ("a", "b"):
        news.on_operator(f"wallride/car1/operator/alive/{session}", alive=True)
    rows = lines("car1", car.situation, advise(car.situation), news, HELD_NAMES)
    text = "\n".join(rows)
    told = "car1: safety: wall ahead, 0.61 m free", "7.9 V", "fault: hot", "operator: you   1 more", "Shift or M drive"
    assert [words for words in told if words not in text] == []
    news.take(b'{"winner": null, "reason": "no word from teleop or navigation", "measure": null}')
    news.on_operator("wallride/car1/operator/alive/b", alive=False)
    text = "\n".join(lines("car1", car.situation, advise(car.situation), news, HELD_NAMES))
    assert "nobody: no word from teleop or navigation" in text
    assert "more" not in text


@pytest.mark.parametrize("payload", [b"", b"[]", b"{", b'{"output": 3, "voltage_v": "x", "battery": 1}', b"\xff"])
def test_news_that_cannot_be_read_change_nothing(payload):
    news = CarState()
    news.take(payload)
    assert news == CarState()


def test_without_a_terminal_one_line_for_every_change():
    out, car = io.StringIO(), Drive()
    screen = Screen(out, plain=False)
    for inputs in (hands(), hands(), hands(Control.MANUAL), hands(Control.MANUAL)):
        car.cycle(inputs)
        advice = advise(car.situation)
        screen.draw([advice.state], advice)
    screen.close()
    assert out.getvalue().split() == ["ready", "DRIVING"]
    assert math.isnan(car.situation.round_trip_s)


@pytest.mark.parametrize("control", [Control.MANUAL, Control.AUTONOMY])
def test_letting_go_of_a_car_that_needs_no_permit_is_not_called_a_stop(control):
    car = Drive()
    car.says(CarCondition.ALONE, operator=SESSION)
    car.hold(hands())
    assert advise(car.situation).next_step.endswith(", without an operator it drives by itself")
    car.hold(hands(control))
    said = advise(car.situation).next_step
    assert "the car drives on by itself; B stops it" in said
    assert "to stop" not in said


def test_another_operators_permit_is_not_taken_for_a_car_that_needs_none():
    car = Drive()
    car.says(CarCondition.PERMITTED, operator=5)
    car.hold(hands())
    car.says(operator=SESSION)
    car.drive()
    assert advise(car.situation).next_step == "release LB to stop"


def test_after_a_loss_it_says_what_to_release_and_when_to_press():
    car = Drive()
    car.says(CarCondition.OPERATOR_LOST, operator=SESSION)
    car.hold(hands())
    assert advise(car.situation).next_step == "our commands came too late: release everything, then press again"
