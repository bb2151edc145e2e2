"""Reasons and angles as people read them: every number has its unit."""

import math

import pytest

from wallride.runtime.telemetry.screen_words import because, steering_words


@pytest.mark.parametrize(
    ("reason", "measure", "words"),
    [
        ("wall ahead", 0.314, "wall ahead, 0.31 m free"),
        ("boxed in", 0.0, "boxed in"),
        ("boxed in", 0.0049, "boxed in"),
        ("the scan is too old", 0.3, "the scan is too old, 0.30 s"),
        ("the scan is late", 0.12, "the scan is late, 0.12 s"),
        ("window clean", math.nan, "window clean"),
        ("clear", math.inf, "clear"),
        ("wall", None, "wall"),
    ],
)
def test_a_reason_has_its_number_with_a_unit(reason, measure, words):
    assert because(reason, measure) == words


@pytest.mark.parametrize(
    ("steering_rad", "words"),
    [(0.21, "12° left"), (-0.34, "19° right"), (0.008, "straight"), (-0.0, "straight"), (None, ""), (math.nan, "")],
)
def test_steering_is_in_degrees_with_its_side(steering_rad, words):
    assert steering_words(steering_rad) == words
