"""The queue against a dictionary that is too simple to be wrong."""

import asyncio

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from wallride.runtime.arbitration.queues import NEVER_S, PriorityQueue
from wallride.sim.virtual.virtual_time import run_virtual

KEYS = st.sampled_from("abcde")


class QueueMachine(RuleBasedStateMachine):
    """Random puts, withdrawals and waits; after each step `live()` is the dictionary's answer."""

    def __init__(self):
        super().__init__()
        self.now_s = 0.0
        self.queue = PriorityQueue(lambda: self.now_s)
        self.model = {}
        self.sequence = 0

    def expected(self):
        alive = [entry for entry in self.model.values() if entry[2] > self.now_s]
        return [entry[3] for entry in sorted(alive, key=lambda entry: entry[:2])]

    @rule(key=KEYS, priority=st.integers(0, 3), lifetime_s=st.sampled_from([0, 1, 2, 5, NEVER_S]))
    def put(self, key, priority, lifetime_s):
        value = object()  # which nothing may compare
        self.sequence += 1
        self.queue.place(key, value, priority=priority, expires_at_s=self.now_s + lifetime_s)
        self.model[key] = (priority, self.sequence, self.now_s + lifetime_s, value)

    @rule(key=KEYS)
    def discard(self, key):
        self.queue.discard(key)
        self.model.pop(key, None)

    @rule(seconds=st.sampled_from([0.5, 1, 3]))
    def wait(self, seconds):
        self.now_s += seconds

    @invariant()
    def shows_what_the_dictionary_shows(self):
        assert self.queue.live() == self.expected()

    @invariant()
    def memory_is_bounded(self):
        assert len(self.queue) <= 5
        assert len(self.queue.sweep()) == len(self.queue), "what expired is gone, and nothing is there twice"


TestQueue = QueueMachine.TestCase
TestQueue.settings = settings(max_examples=2 * settings.default.max_examples, stateful_step_count=30, deadline=None)


def test_changed_wakes_once_per_burst_and_on_a_poke():
    async def story():
        loop = asyncio.get_running_loop()
        queue = PriorityQueue(loop.time)
        for number in range(5):
            queue.place(number, number, priority=0, expires_at_s=NEVER_S)
        await queue.changed()
        loop.call_later(1, queue.tick)
        await queue.changed()
        return loop.time()

    assert run_virtual(story()) == 1.0


def test_a_look_at_one_key_drops_nothing_that_has_expired_unseen():
    now_s = 0.0
    queue = PriorityQueue(lambda: now_s)
    queue.place("a", "word", priority=0, expires_at_s=1.0)
    queue.place("c", "longer", priority=1, expires_at_s=2.0)
    assert (queue.entry("a"), queue.entry("b"), queue.has_expired()) == ("word", None, False)
    now_s = 1.0
    assert (queue.entry("a"), queue.entry("c")) == (None, "longer")
    assert queue.has_expired(), "one of two"
    assert queue.live() == ["longer"]
    assert queue.has_expired(), "to look changes nothing"
    assert queue.sweep() == ["longer"]
    assert not queue.has_expired()


def test_other_priorities_keep_content_age_and_expiry():
    now_s = 0.0
    queue = PriorityQueue(lambda: now_s)
    for key, value, expires_at_s in (("a", 1, 1.0), ("b", 2, NEVER_S), ("c", 3, NEVER_S)):
        queue.place(key, value, priority=ord(key), expires_at_s=expires_at_s)
    queue.change_priorities(lambda key: 0 if key == "c" else 5)
    assert queue.live() == [3, 1, 2], "of equal priority the older first"
    queue.place("b", 4, priority=0, expires_at_s=NEVER_S)
    assert queue.live() == [3, 4, 1], "the old entry of b is gone, though its priority had changed"
    now_s = 1.0
    assert queue.live() == [3, 4]


def test_a_change_is_told_once():
    queue = PriorityQueue(lambda: 0.0)
    assert not queue.take_change()
    queue.place("a", 1, priority=0, expires_at_s=1.0)
    assert [queue.take_change(), queue.take_change()] == [True, False]
    queue.tick()
    assert queue.take_change()
