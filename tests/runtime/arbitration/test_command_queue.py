"""The command queue: one entry per source, in the mux's order, until it expires, is replaced or is withdrawn."""

import asyncio
import math

import pytest

from tests.runtime.observed import HandClock
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import LAB_ORDER, DriveCommand, Source, consent, refusal
from wallride.runtime.arbitration.command_queue import CommandQueue

STICK = DriveCommand(Source.TELEOP, Drive(1.0, 0.0), None, "stick")
WALL = DriveCommand(Source.NAVIGATION, Drive(2.0, 0.0), None, "wall")


class HandQueue(CommandQueue):
    """A queue with a clock that is set by hand."""

    def __init__(self):
        self.hand = HandClock(10.0)
        super().__init__(LAB_ORDER, self.hand)


@pytest.fixture
def queue():
    return HandQueue()


def test_the_most_urgent_comes_first_whatever_was_said_last(queue):
    queue.put(STICK)
    queue.put(WALL)
    queue.put(refusal(Source.ESTOP, "red"))
    assert [word.source for word in queue.live()] == [Source.ESTOP, Source.TELEOP, Source.NAVIGATION]
    assert queue.entry(Source.TELEOP) is STICK


def test_another_order_holds_for_what_is_in_force_and_wakes_the_mux(queue):
    queue.put(STICK)
    queue.put(WALL)
    queue.take_change()
    queue.reorder(LAB_ORDER)
    assert not queue.take_change(), "the same order is no change"
    queue.reorder(LAB_ORDER[::-1])
    assert queue.take_change()
    assert queue.order == LAB_ORDER[::-1]
    assert queue.live() == [WALL, STICK]
    queue.put(refusal(Source.ESTOP, "red"))
    assert queue.live()[-1].source is Source.ESTOP


def test_an_entry_lasts_until_its_expiry_and_not_longer(queue):
    queue.put(STICK, expires_at_s=10.5)
    assert not queue.has_expired()
    queue.hand.now_s = 10.5
    assert queue.has_expired()
    assert queue.entry(Source.TELEOP) is None
    assert queue.live() == []
    assert queue.has_expired(), "a status that looks does not put off the mux's tick"
    assert queue.sweep() == []
    assert not queue.has_expired()


def test_a_word_without_an_expiry_lasts(queue):
    queue.put(STICK)
    queue.hand.now_s = 1e9
    assert queue.live() == [STICK]


def test_what_is_withdrawn_is_gone_and_wakes_the_mux(queue):
    queue.put(STICK, expires_at_s=11.0)
    queue.take_change()
    queue.withdraw(Source.TELEOP)
    assert queue.take_change()
    assert queue.live() == []
    queue.withdraw(Source.PERMIT)


def test_ages_count_from_the_last_word_of_each(queue):
    assert queue.last_put_s == -math.inf
    queue.put(STICK)
    queue.hand.now_s = 12.0
    queue.put(consent(Source.PERMIT, "yes"))
    queue.hand.now_s = 13.0
    assert queue.ages_s() == {Source.TELEOP: 3.0, Source.PERMIT: 1.0}
    assert queue.last_put_s == 12.0


async def test_a_word_or_a_tick_wakes_the_mux_once(queue):
    for wake in (lambda: queue.put(STICK), queue.tick):
        wake()
        async with asyncio.timeout(1):
            await queue.changed()
        assert not queue.take_change()
