"""One latch, several causes: it opens with the last."""

import itertools

import pytest

from wallride.runtime.arbitration.command import LAB_ORDER, Source, arbitrate
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import Cause, EmergencyStop


@pytest.fixture
def queue():
    return CommandQueue(LAB_ORDER, lambda: 0.0)


def words(queue):
    return arbitrate(queue.live(), frozenset(), LAB_ORDER)[0].reason


@pytest.mark.parametrize("order", list(itertools.permutations(Cause)))
def test_it_holds_until_every_cause_is_gone(queue, order):
    stop = EmergencyStop(queue)
    for cause in Cause:
        stop.latch(cause, f"because of {cause}")
    assert words(queue) == "because of operator; because of motor"
    stop.clear(order[0])
    assert stop.latched
    assert words(queue) == f"because of {order[1]}"
    stop.clear(order[1])
    assert stop.causes == {}
    assert queue.live() == []


def test_it_keeps_the_words_with_which_it_began(queue):
    stop = EmergencyStop(queue)
    stop.latch(Cause.OPERATOR, "e-stop by Ann")
    stop.latch(Cause.OPERATOR, "e-stop by Bob")
    assert words(queue) == "e-stop by Ann"
    assert stop.causes == {Cause.OPERATOR: "e-stop by Ann"}


def test_clearing_what_does_not_hold_is_harmless(queue):
    stop = EmergencyStop(queue)
    stop.latch(Cause.MOTOR, "fault")
    stop.clear(Cause.OPERATOR)
    assert [word.source for word in queue.live()] == [Source.ESTOP]
