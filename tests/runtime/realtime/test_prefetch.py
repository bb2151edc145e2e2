"""What an answer runs is learnt once, and fetched before each scan; and nothing else happens."""

import sys
import time
from types import FunctionType

import numpy as np
import pytest

from wallride.drivers.accelerated import UnfitError, extension
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.live_stack import LiveStack, warm_up
from wallride.runtime.realtime.prefetch import LINE_BYTES, learn
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import Settings


class Part:
    """One of the objects that answer."""

    def __init__(self):
        self.measure_m = 0.125

    def step(self):
        return self.measure_m


class Car:
    """Holds its parts not as attributes of its own."""

    def __init__(self, *parts):
        self.parts = {number: [part] for number, part in enumerate(parts)}


def an_answer():
    return Part().step()


def something_else():
    return "is not an answer"


def line_of(thing):
    return id(thing) // LINE_BYTES * LINE_BYTES


def test_what_an_answer_runs_is_learnt():
    lines = set(learn(an_answer, Car()).tolist())
    assert {line_of(an_answer), line_of(an_answer.__code__), line_of(Part), line_of(Part.step)} <= lines
    unneeded = {line_of(one.__code__) for one in vars(np.testing).values() if isinstance(one, FunctionType)}
    assert len(unneeded & lines) < len(unneeded) / 2  # neighbours may share a line


def test_the_cars_own_parts_are_learnt_with_what_they_hold():
    part, other = Part(), something_else
    assert {line_of(part), line_of(part.measure_m)} <= set(learn(an_answer, Car(part, other)).tolist())


def test_the_lines_are_whole_and_none_is_there_twice():
    lines = learn(an_answer, Car())
    assert not (lines % LINE_BYTES).any()
    assert (np.diff(lines) > 0).all()


def test_an_error_of_the_answer_leaves_no_profiler_behind():
    def broken():
        raise ValueError("no answer")

    def profiler(*_):
        pass

    sys.setprofile(profiler)
    try:
        with pytest.raises(ValueError, match="no answer"):
            learn(broken, Car())
        assert sys.getprofile() is profiler
    finally:
        sys.setprofile(None)


def test_a_synthetic_scan_runs_the_laws_of_a_car_and_drives_nothing():
    settings = Settings()
    car = LiveStack(settings, DecisionLog(time.monotonic, 0))
    lines = set(learn(lambda: warm_up(settings, time.monotonic), car).tolist())
    assert {line_of(LiveStack.look.__code__), line_of(SweptGuard.look.__code__), line_of(car.laws.guard)} <= lines
    assert not car.queue.live()


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
