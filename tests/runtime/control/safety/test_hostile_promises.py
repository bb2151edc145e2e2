"""Promises of a source that lies, or is broken: no path, no numbers, another scan's; judged by the arc at once."""

import math
from copy import deepcopy
from functools import partial

import numpy as np
import pytest

from tests.runtime.control.safety.promise_scenes import BESIDE, Promising, changed, judged
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.control.safety import promise_judgement, promise_record, promised_way


def set_to(number, index):
    def made(values):
        values[index] = number
        return values

    return made


HOSTILE = {
    "not a number": (changed(set_to(math.nan, (0, 20))), promised_way.NO_NUMBERS),
    "infinite": (changed(set_to(math.inf, (1, 3))), promised_way.NO_NUMBERS),
    "no speed": (changed(speed=set_to(math.nan, 5)), promised_way.NO_NUMBERS),
    "backward": (changed(speed=set_to(-1.0, 5)), promised_way.NO_NUMBERS),
    "beyond any speed": (changed(speed=set_to(1e308, 5)), promised_way.NO_NUMBERS),
    "no margin": (changed(margin_m=math.nan), promised_way.NO_NUMBERS),
    "negative margin": (changed(margin_m=-0.1), promised_way.NO_NUMBERS),
    "empty": (changed(lambda path_m: path_m[:, :0], lambda speed_mps: speed_mps[:0]), promised_way.NO_NUMBERS),
    "one point": (changed(lambda path_m: path_m[:, :1], lambda speed_mps: speed_mps[:1]), promised_way.NO_NUMBERS),
    "other shape": (changed(lambda path_m: path_m.T), promised_way.NO_NUMBERS),
    "words": (changed(lambda _: "straight on"), promised_way.NO_NUMBERS),
    "nothing": (changed(lambda _: None), promised_way.NO_NUMBERS),
    "too many": (
        changed(lambda path_m: np.tile(path_m, 99), lambda speed: np.tile(speed, 99)),
        promised_way.NO_NUMBERS,
    ),
    "too short": (changed(lambda path_m: path_m[:, :9], lambda speed_mps: speed_mps[:9]), promised_way.TOO_SHORT),
    "of another scan": (changed(at_s=-9.0), promise_judgement.OTHER_SCAN),
    "to come": (changed(at_s=0.5), promise_judgement.OTHER_SCAN),
    "elsewhere": (changed(lambda path_m: path_m + 1.0), promise_record.TAKEN_BACK),
    "turned": (changed(lambda path_m: path_m[::-1]), promise_record.TAKEN_BACK),
    "standing": (changed(np.zeros_like), promised_way.GAPS),
    "with gaps": (changed(lambda path_m: path_m[:, ::8], lambda speed_mps: speed_mps[::8]), promised_way.GAPS),
}


@pytest.mark.parametrize(("promise", "reason"), HOSTILE.values(), ids=HOSTILE)
def test_what_is_no_path_is_judged_by_the_arc_at_once(promise, reason):
    car = Promising()
    refused = car.record.refused
    promised, plain = judged(car, BESIDE, promise)
    assert promised == plain
    assert (car.record.reason, car.record.refused) == (reason, refused + 1)
    assert car.guard.words == (f"the promised path is not believed: {reason} ({refused + 1} times)",)


def test_random_promises_never_raise_and_never_allow_more_than_both_judgements():
    rng, trusted = np.random.default_rng(46), Promising(24)
    for _ in range(150):
        car = deepcopy(trusted)
        count = int(rng.integers(0, 40))
        path_m = np.cumsum(rng.normal(0.1, rng.choice((0.0, 0.02, 1.0)), (2, count)), axis=1)
        path_m = np.where(rng.random(path_m.shape) < 0.02, rng.choice((math.nan, math.inf, 1e300)), path_m)
        promised, plain = judged(car, BESIDE, partial(Promise, path_m, rng.normal(2, 2, count), 0.1))
        assert promised == plain
