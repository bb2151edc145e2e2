"""The live stack: what a scan puts into the command queue, for how long, and what a change of settings reaches."""

import numpy as np
import pytest

from tests.runtime.observed import HandClock
from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.arbitration.command import DriveCommand, Source, SpeedLimit, arbitrate, consent
from wallride.runtime.control.line_following.line_follower import NO_LINE
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import load_settings
from wallride.sim.virtual.devices import BEAMS, STEP_RAD, ranges_between_walls


class Desk:
    """A stack on a clock set by hand."""

    def __init__(self, *wanted, most=64):
        self.clock = HandClock(100.0)
        self.decision_log = DecisionLog(self.clock, most)
        self.stack = LiveStack(load_settings(None, wanted), self.decision_log)

    def scan(self, ranges_m=None):
        now_s = self.clock.now_s
        seen_m = ranges_between_walls(1.0, 1.0) if ranges_m is None else ranges_m
        return Scan(now_s, now_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, seen_m.astype(np.float32), 0)

    def answer(self, ranges_m=None):
        scan = self.scan(ranges_m)
        self.stack.look(scan, REST)
        self.stack.follow(scan, REST)

    def live(self):
        return {word.source: word for word in self.stack.queue.live()}


REST = MotorState(100.0, 0.0, 0.0, 0.0, 12.0, 0.0, 0.0, 20.0, "", timed_out=False, killed=False)


def test_each_law_says_one_word_from_the_scan_it_was_made_of():
    desk = Desk()
    desk.answer()
    safety, navigation = desk.live()[Source.SAFETY], desk.live()[Source.NAVIGATION]
    assert isinstance(safety, SpeedLimit)
    assert isinstance(navigation, DriveCommand)
    assert safety.scan_stamp_s == navigation.scan_stamp_s == 100.0


@pytest.mark.parametrize(
    ("section", "source"), [("safety", Source.SAFETY), ("wall_follow", Source.NAVIGATION)], ids=["safety", "navigation"]
)
def test_a_word_is_in_force_only_so_long_after_its_scan(section, source):
    desk = Desk(f"{section}.expires_after_s=0.1")
    desk.answer()
    desk.clock.now_s += 0.09
    assert source in desk.live()
    desk.clock.now_s += 0.02
    assert source not in desk.live()


def test_a_follower_without_an_answer_asks_for_standstill():
    desk = Desk("wall_follow.no_wall=stop")
    desk.answer(np.full(BEAMS, np.nan))
    assert desk.live()[Source.NAVIGATION].drive == Drive(0.0, 0.0)


def test_a_follower_that_drives_at_a_speed_of_its_own_keeps_its_reason():
    desk = Desk("wall_follow.method=line", "wall_follow.speed_mps=0")
    desk.answer()
    desk.answer()
    navigation = desk.live()[Source.NAVIGATION]
    assert navigation.drive.speed_mps > 0.0
    assert navigation.reason == NO_LINE


def test_a_follower_that_was_given_no_speed_names_the_setting():
    desk = Desk("wall_follow.speed_mps=0")
    desk.answer()
    navigation = desk.live()[Source.NAVIGATION]
    assert (navigation.drive.speed_mps, navigation.reason) == (0.0, "wall_follow.speed_mps is 0")


def test_without_the_words_of_all_required_sources_nothing_moves():
    desk = Desk()
    desk.answer()
    assert arbitrate(desk.stack.queue.live(), REQUIRED, desk.stack.queue.order)[0].speed_mps == 0.0
    desk.stack.queue.put(consent(Source.PERMIT, "test"))
    assert arbitrate(desk.stack.queue.live(), REQUIRED, desk.stack.queue.order)[0].speed_mps > 0.0


def test_other_settings_reach_laws_limiter_order_and_the_log():
    desk = Desk()
    changed = load_settings(None, ["wall_follow.speed_mps=0.5", "car.max_speed_mps=0.4", "safety.binds_teleop=false"])
    desk.stack.apply(changed)
    assert desk.stack.settings is changed
    assert desk.stack.laws.wall_follow.speed_mps == 0.5
    assert desk.stack.limiter.limit(9.0, 0.0, 1e3).speed_mps == 0.4
    assert desk.stack.queue.order == changed.effective_order()
    assert [kind for _, kind, _ in desk.decision_log.drain()] == ["settings", "settings"]


def test_the_log_has_both_answers_in_their_order():
    desk = Desk()
    desk.answer()
    assert [kind for _, kind, _ in desk.decision_log.drain()] == ["settings", "look", "follow"]
