"""After a fault of an own law: the permit ends, and the next one tries the law again; without a permit time does."""

import math

import pytest

from runtime.arbitration.command_queue import CommandQueue
from runtime.arbitration.permit import Permit
from runtime.settings.tree import Settings
from runtime.tasks.own_law import MAX_RETRY_S, OwnLawWatch
from tests.runtime.observed import HandClock


class Laws:
    own_law_fault = ""
    own_law_faults = 0

    def fail(self):
        self.own_law_fault = "my_laws:Follower raised ValueError (my_laws.py:7)"
        self.own_law_faults += 1


class Rig:
    def __init__(self, mode):
        self.clock, self.laws = HandClock(), Laws()
        self.permit = Permit(CommandQueue(Settings().effective_order(), self.clock), mode)
        self.told, self.tries_s = [], []
        self.watch = OwnLawWatch(self.laws, self.permit, self.rearm, self.retry, self.clock)  # type: ignore[arg-type]

    def rearm(self, reason):
        self.told.append(reason)
        self.permit.revoke(reason)

    def retry(self):
        self.tries_s.append(self.clock())
        self.laws.own_law_fault = ""

    def ticks(self, seconds=0.05):
        for _ in range(round(seconds / 0.05)):
            self.clock.now_s += 0.05
            self.watch.tick(0.0, 0)


@pytest.fixture
def required():
    return Rig("required")


def test_a_fault_ends_the_permit_and_says_why(required):
    required.permit.grant(until_s=math.inf)
    required.laws.fail()
    required.ticks()
    assert required.told == ["my_laws:Follower raised ValueError (my_laws.py:7); permit again"]
    assert required.permit.until_s == -math.inf


def test_only_the_next_permit_tries_again(required):
    required.permit.grant(until_s=math.inf)
    required.laws.fail()
    required.ticks(100.0)
    assert required.tries_s == []
    required.permit.grant(until_s=math.inf)
    required.ticks()
    assert len(required.tries_s) == 1


def test_a_fault_without_a_permit_interrupts_no_human(required):
    required.laws.fail()
    required.ticks()
    assert required.told == []
    required.permit.grant(until_s=math.inf)
    required.ticks()
    assert len(required.tries_s) == 1


def test_a_law_that_fails_at_every_permit_takes_every_permit(required):
    for _ in range(3):
        required.permit.grant(until_s=math.inf)
        required.ticks()
        required.laws.fail()
        required.ticks()
        assert required.permit.until_s == -math.inf
    assert len(required.told) == 3


def test_where_no_permit_is_required_time_tries_again_and_waits_longer_each_time():
    rig = Rig("always")
    for _ in range(8):
        rig.laws.fail()
        rig.ticks(0.1)
        while rig.laws.own_law_fault:
            rig.ticks()
    gaps_s = [round(later - sooner) for sooner, later in zip(rig.tries_s, rig.tries_s[1:], strict=False)]
    assert gaps_s[:4] == [4, 8, 16, 32]
    assert max(gaps_s) == MAX_RETRY_S
