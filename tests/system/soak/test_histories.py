"""Random histories of the whole car, and that each planted breach is found.

The 20,000 are `python -m benchmarks.histories`.
"""

import pytest

from tests.system.soak.histories import EVENTS, PLANNERS, tell
from tests.system.soak.history_rules import AUTONOMY, GOODBYE, MANUAL, Judge, Moved
from wallride.runtime.arbitration.command import consent
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.control.own_laws.runner import LawRunner
from wallride.runtime.teleop import planners
from wallride.runtime.teleop.desk import OperatorDesk, TeleopStatements
from wallride.runtime.teleop.sessions import Beats

LATE_S = 0.5
PERMIT = "autonomy without a fresh permit after the last incident"
HAND = "by hand without a fresh press after the last incident"


def test_no_history_breaks_a_rule():
    found = tell(range(1, 13))
    assert found.violations == {}, found.kept
    assert set(found.moved) == {"teleop", "planner", "navigation"}
    assert set(found.incidents) >= {"e-stop", "planner lost", "law", "lidar lost", "motor lost", "motor fault"}
    assert set(found.events) >= set(EVENTS)


def test_a_new_permit_after_a_planners_loss_gives_the_car_to_the_next_planner_in_force():
    found = tell([423])
    assert found.violations == {}, found.kept


def test_what_a_stalled_process_has_not_seen_and_a_law_whose_permit_is_over_break_no_rule():
    """Faults just before a stall of 0.1 s, a law that raised just before its operator drove by hand, or left, and
    devices that were gone before the process, stalled at its start, had seen them at all."""
    found = tell([202159, 212564, 216455, 207085, 209405, 79001164, 114001660, 114015605])
    assert found.violations == {}, found.kept


def test_the_same_seed_is_the_same_history():
    assert tell([7]) == tell([7])


def later(method):
    def sent_later(self, number):
        sent_s = method(self, number)
        return None if sent_s is None else sent_s + LATE_S

    return sent_later


def longer(method):
    def lasting(self, *args, until_s, **more):
        method(self, *args, until_s=until_s + LATE_S, **more)

    return lasting


@pytest.mark.parametrize(
    ("place", "name", "breach", "rule", "first"),
    [
        (EmergencyStop, "latch", lambda *_: None, "motion while latched: e-stop", 4),
        (Beats, "sent_at_s", later(Beats.sent_at_s), PERMIT, 15),
        (TeleopStatements, "drive", longer(TeleopStatements.drive), HAND, 14),
        (OperatorDesk, "rearm", lambda *_: None, PERMIT, 1),
        (planners, "refusal", consent, "the follower drives although a planner has the car", 4),
        (LawRunner, "_note", lambda *_: None, "a law with a fault drives", 6),
    ],
    ids=["latch", "lease", "deadman", "rearm", "hold", "law"],
)
def test_a_planted_breach_is_found(monkeypatch, place, name, breach, rule, first):
    monkeypatch.setattr(place, name, breach)
    found = tell(range(first, first + 60), lambda found: rule not in found.violations)
    assert rule in found.violations, found.violations


class Told:
    """A judge with an operator who permits, and both planners."""

    def __init__(self):
        self.now_s = 0.0
        self.judge = Judge(lambda: self.now_s, PLANNERS)
        self.judge.scan_s = 0.0
        self.judge.beat(1, 5, permitted=True)
        self.judge.pressed(5, 1, 1, 0, 0.0)
        self.judge.pressed(5, 2, 1, AUTONOMY, 0.0)

    def moves(self, driver, mark=0.0):
        self.judge.sent(Moved(self.now_s, 1.0, driver, mark))
        return dict(self.judge.violations)


def test_only_the_most_urgent_planner_in_force_may_drive():
    told = Told()
    for name, mark in (("beta", 0.2), ("alpha", 0.1)):
        told.judge.planned(name, 11, 1, 1, MANUAL, mark)
    assert told.moves("planner", 0.1) == {}
    assert told.moves("planner", 0.2) == {"not the most urgent planner drives": 1}
    told.judge.planned("alpha", 11, 2, 1, 32, 0.0)
    assert told.moves("planner", 0.2) == {"not the most urgent planner drives": 1}
    assert "the follower drives although a planner has the car" in told.moves("navigation")


@pytest.mark.parametrize("raised", [False, True])
def test_what_was_pressed_while_another_operated_moves_nothing_when_that_one_leaves(raised):
    told = Told()
    told.judge.beat(2, 5, permitted=True)
    for sequence, flags in ((1, 0), (2, AUTONOMY)):
        told.judge.pressed(6, sequence, 2, flags, 0.0)
    if raised:
        told.judge.law_raised()
    told.judge.pressed(5, 3, 2, GOODBYE, 0.0)
    told.now_s = 0.1
    assert told.moves("planner")[PERMIT] == 1
    for sequence, flags in ((3, 0), (4, AUTONOMY)):
        told.judge.pressed(6, sequence, 2, flags, 0.0)
    assert told.moves("planner")[PERMIT] == 1


def test_a_planner_that_falls_silent_ends_the_permit_and_one_that_leaves_does_not():
    for leaves in (True, False):
        told = Told()
        told.judge.planned("beta", 11, 1, 1, MANUAL, 0.2)
        told.now_s = 0.1
        told.judge.beat(2, 5, permitted=True)
        told.judge.pressed(5, 3, 2, AUTONOMY, 0.0)
        if leaves:
            told.judge.planned("beta", 11, 2, 1, 32, 0.0)
        told.now_s = told.judge.scan_s = 0.21
        assert (told.moves("navigation") == {}) is leaves
