"""What an answer runs is seen, and fetched before the next one; and nothing else happens."""

import sys
from typing import Any

import numpy as np
import pytest

from drivers.accelerated import UnfitError, extension
from runtime.realtime.cache_lines import LINE_BYTES
from runtime.realtime.prefetch import WATCHED_EVERY, Warmth


class Fetched(list[Any]):
    """Takes the place of the processor."""

    def __call__(self, lines):
        self.append(lines)


def an_answer():
    return "the code that is looked for"


def something_else():
    return "is not an answer"


@pytest.fixture
def fetched():
    return Fetched()


@pytest.fixture
def warmth(fetched):
    warmth = Warmth(fetched)
    yield warmth
    warmth.stop()
    assert sys.getprofile() is None


def test_what_an_answer_runs_is_fetched_before_the_next_one(warmth, fetched):
    warmth.warm()
    an_answer()
    warmth.answered()
    something_else()
    assert fetched[-1].size == 0, "nothing is known before the first answer"
    warmth.warm()
    assert an_answer.__code__ in warmth.known
    assert something_else.__code__ not in warmth.known
    assert id(an_answer.__code__) // LINE_BYTES * LINE_BYTES in fetched[-1]


def test_of_many_answers_one_is_watched_now_and_then(warmth):
    watched = []
    for number in range(1, 2 * WATCHED_EVERY + 1):
        warmth.warm()
        if sys.getprofile() is not None:
            watched.append(number)
        if number > 600:
            an_answer()
        warmth.answered()
    assert watched == [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000, 1024, 2000]
    assert an_answer.__code__ in warmth.known, "what runs only later is learnt later"


def test_where_no_scan_came_nothing_is_learnt(warmth):
    warmth.warm()
    something_else()
    warmth.warm()
    assert sys.getprofile() is None
    warmth.answered()
    assert not warmth.known


def test_somebody_elses_profiler_is_left_alone(warmth):
    def profiler(*_):
        pass

    sys.setprofile(profiler)
    try:
        warmth.warm()
        warmth.answered()
        assert sys.getprofile() is profiler
    finally:
        sys.setprofile(None)


def test_without_a_compiler_nothing_is_watched():
    warmth = Warmth(None)
    warmth.warm()
    assert sys.getprofile() is None


def test_what_is_known_stays_known_when_an_answer_does_less(warmth):
    warmth.warm()
    an_answer()
    warmth.answered()
    warmth.warm()
    something_else()
    warmth.answered()
    assert {an_answer.__code__, something_else.__code__} <= warmth.known


class Part:
    """One of those that are there at every answer."""

    def __init__(self):
        self.measure_m = 0.125

    def step(self):
        return self.measure_m


def line_of(thing):
    return id(thing) // LINE_BYTES * LINE_BYTES


def test_what_is_there_at_every_answer_is_fetched_with_what_it_holds(warmth, fetched):
    part, gone = Part(), []
    for _ in range(4):
        warmth.warm()
        part.step()
        passing = Part()
        passing.step()
        gone.append(passing)  # kept, so that none takes the place of another
        warmth.answered()
    assert id(part) in warmth.lasting
    assert not {id(one) for one in gone} & warmth.lasting.keys()
    assert {line_of(part), line_of(Part), line_of(Part.step), line_of(part.measure_m)} <= set(fetched[-1].tolist())


def test_what_is_there_no_more_is_let_go(warmth):
    first, second = Part(), Part()
    for number in range(1, 9):  # the first two, the fourth and the eighth are watched
        warmth.warm()
        (first if number < 4 else second).step()
        warmth.answered()
        assert (id(first) in warmth.lasting) == (number in {2, 3})
    assert id(second) in warmth.lasting


def test_the_processor_takes_any_address_as_a_hint():
    try:
        prefetch = extension().prefetch
    except UnfitError as reason:
        pytest.skip(str(reason))
    prefetch(np.array([0, 64, -64, np.iinfo(np.intp).max, id(prefetch)], np.intp))
    with pytest.raises(TypeError):
        prefetch(np.array([0.5]))
    with pytest.raises(TypeError):
        prefetch(np.zeros((2, 2), np.intp))
