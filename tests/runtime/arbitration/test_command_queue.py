"""The command queue: one entry per source, in the mux's order, until it expires, is replaced or is withdrawn."""

import asyncio
import math

import pytest

from drivers.api import Drive
from runtime.arbitration.command import LAB_ORDER, DriveCommand, Source, consent, refusal
from runtime.arbitration.command_queue import CommandQueue
from tests.runtime.observed import HandClock

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
    queue.say(STICK)
    queue.say(WALL)
    queue.say(refusal(Source.ESTOP, "red"))
    assert [word.source for word in queue.live()] == [Source.ESTOP, Source.TELEOP, Source.NAVIGATION]
    assert queue.word(Source.TELEOP) is STICK


def test_another_order_holds_for_what_is_in_force_and_wakes_the_mux(queue):
    queue.say(STICK)
    queue.say(WALL)
    queue.take_news()
    queue.reorder(LAB_ORDER)
    assert not queue.take_news(), "the same order is no change"
    queue.reorder(LAB_ORDER[::-1])
    assert queue.take_news()
    assert queue.order == LAB_ORDER[::-1]
    assert queue.live() == [WALL, STICK]
    queue.say(refusal(Source.ESTOP, "red"))
    assert queue.live()[-1].source is Source.ESTOP


def test_an_entry_lasts_until_its_expiry_and_not_longer(queue):
    queue.say(STICK, expires_at_s=10.5)
    assert not queue.somebody_expired()
    queue.hand.now_s = 10.5
    assert queue.somebody_expired()
    assert queue.word(Source.TELEOP) is None
    assert queue.live() == []
    assert not queue.somebody_expired()


def test_a_word_without_an_expiry_lasts(queue):
    queue.say(STICK)
    queue.hand.now_s = 1e9
    assert queue.live() == [STICK]


def test_what_is_withdrawn_is_gone_told_and_wakes_the_mux(queue):
    said, silenced = [], []
    queue.on_said, queue.on_silenced = lambda *word: said.append(word), silenced.append
    queue.say(STICK, expires_at_s=11.0)
    queue.take_news()
    queue.silence(Source.TELEOP)
    assert queue.take_news()
    assert (said, silenced) == ([(STICK, 11.0)], [Source.TELEOP])
    assert queue.live() == []
    queue.silence(Source.PERMIT)


def test_ages_count_from_the_last_word_of_each(queue):
    assert queue.spoken_s == -math.inf
    queue.say(STICK)
    queue.hand.now_s = 12.0
    queue.say(consent(Source.PERMIT, "yes"))
    queue.hand.now_s = 13.0
    assert queue.ages_s() == {Source.TELEOP: 3.0, Source.PERMIT: 1.0}
    assert queue.spoken_s == 12.0


async def test_a_word_or_a_tick_wakes_the_mux_once(queue):
    for wake in (lambda: queue.say(STICK), queue.tick):
        wake()
        async with asyncio.timeout(1):
            await queue.changed()
        assert not queue.take_news()
