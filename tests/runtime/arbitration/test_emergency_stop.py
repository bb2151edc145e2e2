"""One latch, several causes: it opens with the last."""

import itertools

import pytest

from runtime.arbitration.command import LAB_ORDER, Source, arbitrate
from runtime.arbitration.command_queue import CommandQueue
from runtime.arbitration.emergency_stop import Cause, EmergencyStop


@pytest.fixture
def voices():
    return CommandQueue(LAB_ORDER, lambda: 0.0)


def words(voices):
    return arbitrate(voices.live(), frozenset(), LAB_ORDER).reason


@pytest.mark.parametrize("order", list(itertools.permutations(Cause)))
def test_it_holds_until_every_cause_is_gone(voices, order):
    stop = EmergencyStop(voices)
    for cause in Cause:
        stop.latch(cause, f"because of {cause}")
    assert words(voices) == "because of operator; because of motor"
    stop.clear(order[0])
    assert stop.latched
    assert words(voices) == f"because of {order[1]}"
    stop.clear(order[1])
    assert stop.causes == {}
    assert voices.live() == []


def test_it_keeps_the_words_with_which_it_began(voices):
    stop = EmergencyStop(voices)
    stop.latch(Cause.OPERATOR, "e-stop by Ann")
    stop.latch(Cause.OPERATOR, "e-stop by Bob")
    assert words(voices) == "e-stop by Ann"
    assert stop.causes == {Cause.OPERATOR: "e-stop by Ann"}


def test_clearing_what_does_not_hold_is_harmless(voices):
    stop = EmergencyStop(voices)
    stop.latch(Cause.MOTOR, "fault")
    stop.clear(Cause.OPERATOR)
    assert [word.source for word in voices.live()] == [Source.ESTOP]
