"""After a fault of an own law: the permit ends, and the next one tries the law again; without a permit time does."""

import itertools
import math
import re
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.runtime.observed import HandClock
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks.own_law import MAX_RETRY_S, OwnLawWatch


class Laws:
    """Laws of which one is of the user."""

    own_law_fault = ""

    def __init__(self):
        law = SimpleNamespace(name="my_laws:Follower", file=Path(__file__))
        self.runner = SimpleNamespaceById(law=law, faults=0, last_fault="")
        self.runners = [self.runner]

    def fail(self):
        self.own_law_fault = self.runner.last_fault = "my_laws:Follower raised ValueError (my_laws.py:7)"
        self.runner.faults += 1


def wait_here(over):
    """Wait with a frame in this file, which is the law's."""
    over.wait()


class SimpleNamespaceById(SimpleNamespace):
    __hash__ = object.__hash__  # type: ignore[assignment]


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

    def ticks(self, seconds=0.05, late_s=0.0):
        for _ in range(round(seconds / 0.05)):
            self.clock.now_s += 0.05
            self.watch.tick(late_s, 0)


@pytest.fixture
def required():
    return Rig("required")


def test_a_fault_ends_the_permit_and_says_why(required):
    required.permit.grant(until_s=math.inf)
    required.laws.fail()
    required.ticks()
    assert required.told == ["my_laws:Follower raised ValueError (my_laws.py:7); permit again"]
    assert required.permit.until_s == -math.inf


def test_a_fault_that_was_tried_again_before_it_was_seen_ends_the_permit(required):
    required.permit.grant(until_s=math.inf)
    required.laws.fail()
    required.retry()  # a slider of the law's own settings
    required.ticks()
    assert required.told == ["my_laws:Follower raised ValueError (my_laws.py:7); permit again"]


def test_a_fault_of_a_law_that_has_replaced_another_with_one_is_seen(required):
    for _ in range(2):
        required.permit.grant(until_s=math.inf)
        required.laws.fail()
        required.ticks()
        assert required.permit.until_s == -math.inf
        required.laws = required.watch._laws = Laws()


def test_threads_of_a_law_are_named_once_and_again_when_the_loop_was_held_up(required, caplog):
    over = threading.Event()
    threads = [threading.Thread(target=over.wait) for _ in range(2)]
    for thread in threads:
        thread.start()
    try:
        ours = threading.Thread(target=wait_here, args=(over,))
        ours.start()
        threads.append(ours)
        required.ticks(3.0)
        assert re.fullmatch(
            r"my_laws:Follower runs 1 thread of its own \(.*test_own_law\.py:\d+\), which takes time from driving",
            required.watch.words[0],
        )
        assert len(caplog.records) == 1
        required.ticks(late_s=0.12)
        assert "the car was held up for 120 ms: my_laws:Follower runs 1 thread" in caplog.text
    finally:
        over.set()
        for thread in threads:
            thread.join()
    required.ticks(1.1)
    assert required.watch.words == ()


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


def test_the_signals_are_put_back_each_second_also_where_only_drivers_are_the_users(required, monkeypatch):
    times_s: list[float] = []
    held = SimpleNamespace(put_back=lambda: times_s.append(required.clock()))
    monkeypatch.setattr("wallride.runtime.tasks.own_law.STOP_SIGNALS_HELD", held)
    required.laws.runners = []
    required.ticks(3.3)
    assert len(times_s) == 4
    assert max(later - sooner for sooner, later in itertools.pairwise(times_s)) <= 1.1
