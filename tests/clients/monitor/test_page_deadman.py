"""The deadman of a calibration from a page: held is only what is said now, with a fresh heartbeat, after a release."""

import pytest

from wallride.clients.calibration.link import LetGoError
from wallride.clients.monitor.calibration import PageDeadman
from wallride.clients.monitor.driving import SILENT_S
from wallride.clients.monitor.messages import InputState
from wallride.clients.teleop.pilot import LINK_LOST_S
from wallride.runtime.wire.teleop import Beat, CarCondition


class Story:
    """A page that says what it holds, every 25 ms, and a car that beats as often."""

    def __init__(self):
        self.now_s = 10.0
        self.deadman = PageDeadman(lambda: self.now_s)
        self.number = 0

    def goes_on(self, time_s=0.025):
        self.now_s += time_s

    def beats(self):
        self.number += 1
        self.deadman.hear(Beat(7, self.number, CarCondition(0)), self.now_s)

    def says(self, *held, beat=None):
        number = self.number if beat is None else beat
        hands = InputState(t="hands", car_session=7, beat=number, held=list(held), speed=0, steering=0)
        self.deadman.take(hands, self.now_s)

    def holds(self, *held, times=4):
        for _ in range(times):
            self.goes_on()
            self.beats()
            self.says(*held)


@pytest.fixture
def story():
    return Story()


def test_what_was_held_before_it_was_seen_released_does_not_count(story):
    story.holds("manual")
    assert not story.deadman.is_held()
    story.holds()
    story.holds("manual")
    assert story.deadman.is_held()


@pytest.mark.parametrize("held", [(), ("autonomy",), ("manual", "autonomy"), ("manual", "estop")])
def test_nothing_but_the_deadman_alone_is_held(story, held):
    story.holds()
    story.holds(*held)
    assert not story.deadman.is_held()


def test_a_silent_page_holds_nothing_and_has_to_release(story):
    story.holds()
    story.holds("manual")
    story.goes_on(SILENT_S + 0.001)
    assert not story.deadman.is_held()
    story.beats()
    story.says("manual")
    assert not story.deadman.is_held()
    story.holds()
    story.holds("manual")
    assert story.deadman.is_held()


@pytest.mark.parametrize("beat", ["old", "invented"])
def test_a_page_that_is_late_holds_nothing(story, beat):
    story.holds()
    story.holds("manual", times=20)
    old = story.number - round(LINK_LOST_S / 0.025) - 1
    story.says("manual", beat=old if beat == "old" else 999)
    assert not story.deadman.is_held()


@pytest.mark.parametrize("end", ["lose", "leave"])
def test_a_lost_or_left_page_has_to_release(story, end):
    story.holds()
    story.holds("manual")
    getattr(story.deadman, end)()
    assert not story.deadman.is_held()
    story.holds("manual")
    assert not story.deadman.is_held()


def test_its_end_ends_who_drives_with_it(story):
    story.holds()
    story.holds("manual")
    story.deadman.end("STOP")
    with pytest.raises(LetGoError, match="STOP"):
        story.deadman.is_held()
    with pytest.raises(LetGoError, match="STOP"):
        story.deadman.renew()
