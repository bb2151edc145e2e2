"""A page's hands and the car's real desk, in virtual time: what the car does while pages freeze, hide and close."""

import pytest

from tests.runtime.operator_rig import BEAT_S, Rig
from wallride.clients.monitor.driving import SILENT_S, PageDriver
from wallride.clients.monitor.messages import InputState
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.arbitration.command import Source
from wallride.runtime.wire.teleop import Press

FEEL = InputShape(max_speed_mps=2.0, ramp_mps2=1000.0, deadzone=0.0, expo=0.0)


class Page:
    """A page, its server's half and a car. lag: how many beats the page is behind."""

    def __init__(self, permit="required"):
        self.rig = Rig(permit)
        self.driver = PageDriver("ann", FEEL)
        self.rig.clients.append(self)
        self.beats = []
        self.lag = 0
        self.sent = []

    def hear(self, beat):
        self.beats.append(beat)
        self.driver.hear(beat, self.rig.now_s)

    def send(self, *commands):
        for command in commands:
            if command is not None:
                self.sent.append(command)
                self.rig.desk.receive("", command.pack(), self.rig.now_s)

    def hold(self, *held, speed=0.0, seconds=0.2, **more):
        for _ in range(round(seconds / BEAT_S)):
            self.rig.wait(BEAT_S)
            beat = self.beats[-1 - self.lag]
            now = {"car_session": beat.car_session, "beat": beat.beat, "held": list(held), "speed": speed}
            word = InputState(t="hands", steering=0, **now, **more)
            self.send(self.driver.take_input(word, self.rig.now_s))
            self.send(self.driver.tick(self.rig.now_s))

    def silence(self, seconds):
        """Let the page stand still; return when the car stopped, None when it did not."""
        stopped_s = None
        for i in range(round(seconds / BEAT_S)):
            self.rig.wait(BEAT_S)
            self.send(self.driver.tick(self.rig.now_s))
            if stopped_s is None and self.rig.speed_mps == 0:
                stopped_s = (i + 1) * BEAT_S
        return stopped_s

    def drive(self):
        self.hold()
        self.hold("manual")
        self.hold("manual", speed=1.0)
        assert self.rig.speed_mps == 2.0
        assert self.rig.decision.driver is Source.TELEOP


@pytest.fixture(params=["required", "always"])
def page(request):
    return Page(request.param)


def test_a_page_drives_and_its_release_stops(page):
    page.drive()
    page.hold(seconds=BEAT_S)
    assert page.rig.decision.driver is not Source.TELEOP


def test_the_sliders_share_holds(page):
    page.hold()
    page.hold("manual")
    page.hold("manual", speed=1.0, share=0.25)
    assert page.rig.speed_mps == 0.5


def test_a_frozen_page_stops_the_car_and_stays_stopped_until_released(page):
    page.drive()
    assert page.silence(1.5) <= SILENT_S + 2 * BEAT_S
    assert page.rig.speed_mps == 0
    page.hold("manual", speed=1.0, seconds=0.5)
    assert page.rig.speed_mps == 0, "it thaws with the finger still down"
    page.drive()


def test_a_silent_page_is_not_talked_for_for_ever(page):
    page.drive()
    page.silence(1.5)
    before = len(page.sent)
    page.silence(5)
    assert len(page.sent) == before


def test_a_page_that_answers_late_cannot_drive(page):
    page.drive()
    page.lag = 12  # 0.24 s behind: its clicks are, too
    page.hold("manual", speed=1.0, seconds=0.4)
    assert page.rig.speed_mps == 0


def test_a_closed_page_stops_the_car_at_once_and_autonomy_does_not_take_over(page):
    page.drive()
    page.send(*page.driver.leave(page.rig.now_s, deliberate=False))
    assert page.rig.speed_mps == 0
    page.silence(10)
    assert page.rig.speed_mps == 0


def test_a_dropped_touch_stops_the_car_and_the_next_release_does_not_let_autonomy_go(page):
    page.drive()
    page.send(page.driver.drop(page.rig.now_s))
    assert page.rig.speed_mps == 0
    page.hold(seconds=1.0)
    assert page.rig.speed_mps == 0
    page.drive()


def test_switching_off_deliberately_is_a_goodbye(page):
    page.drive()
    page.hold()
    words = page.driver.leave(page.rig.now_s, deliberate=True)
    assert {command.flags for command in words} == {Press.GOODBYE}
    page.send(*words)
    assert page.rig.desk.view().operator == ""
    page.drive()  # a page that comes back begins anew


def test_a_watching_page_sends_nothing_but_its_stop_is_repeated_until_it_is_confirmed():
    page = Page("always")
    page.silence(0.5)
    assert page.sent == []
    page.rig.clients.clear()  # the beats do not get through
    page.send(page.driver.stop(page.rig.now_s))
    assert page.rig.e_stop.latched
    page.silence(0.5)
    assert len(page.sent) > 20
    assert {command.flags for command in page.sent} == {Press.ESTOP}
    page.rig.clients.append(page)
    page.silence(0.5)
    before = len(page.sent)
    page.silence(1)
    assert len(page.sent) == before


def test_a_reset_needs_a_long_press_and_moves_nothing():
    page = Page("always")
    page.drive()
    page.send(page.driver.stop(page.rig.now_s))
    page.hold(seconds=0.5)
    page.hold("reset", seconds=0.8)
    too_short = page.rig.e_stop.latched
    assert too_short
    page.hold("reset", seconds=0.4)
    assert not page.rig.e_stop.latched
    page.hold(seconds=1)
    assert page.rig.speed_mps == 0


def test_a_gamepad_that_says_nothing_new_is_no_hand(page):
    page.hold()
    page.hold("manual", pad=True, age_ms=10)
    page.hold("manual", pad=True, age_ms=10, speed=1.0)
    assert page.rig.speed_mps == 2.0
    page.hold("manual", pad=True, age_ms=1500, speed=1.0)
    assert page.rig.speed_mps == 0


def test_the_view_says_what_to_do():
    page = Page()
    assert page.driver.view(page.rig.now_s)["state"] == "watching"
    page.drive()
    view = page.driver.view(page.rig.now_s)
    assert (view["state"], view["mood"], view["mine"], view["manual"]) == ("DRIVING", "green", True, True)
    page.silence(0.2)
    assert page.driver.view(page.rig.now_s)["silent"]
