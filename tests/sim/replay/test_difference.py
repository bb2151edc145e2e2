"""What counts as the same, and how a difference reads."""

import math
from dataclasses import replace

import pytest

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import Decision, Output, Source
from wallride.runtime.control.guidance import Guidance
from wallride.sim.replay.difference import Difference, guidances, outputs, same

DECISION = Decision(1.0, 0.1, Source.NAVIGATION, Source.SAFETY, "slower: wall ahead", 1.5)
OUTPUT = Output(3.0, Drive(1.0, 0.1), DECISION, delivered=True)
GUIDANCE = Guidance(Drive(1.0, 0.1), 0.9, -0.1, 0.0, "wall")


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        (1.0, 1.0, True),
        (math.nan, math.nan, True),
        (math.nan, 1.0, False),
        (math.inf, math.inf, True),
        (1.0, math.nextafter(1.0, 2.0), True),
        (1.0, 1.0 + 1e-8, False),
        (None, None, True),
        (None, 0.0, False),
        ("a", "a", True),
        (Source.SAFETY, Source.TELEOP, False),
    ],
)
def test_the_same_is_the_same_but_for_rounding(one, other, is_same):
    assert same(one, other) is is_same


def test_closeness_is_for_numbers_only():
    assert same(1.0, 1.01, 0.02)
    assert not same(1.0, 1.03, 0.02)
    assert not same("a", "b", 0.02)
    assert not same(math.inf, 1.0, 0.02)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"winner": Source.NAVIGATION}, "winner"),
        ({"driver": Source.TELEOP}, "driver"),
        ({"reason": "wall ahead"}, "reason"),
        ({"speed_mps": 0.9}, "allowed speed [m/s]"),
        ({"steering_rad": None}, "steering [rad]"),
        ({"brake_mps2": 2.0}, "brake [m/s2]"),
        ({"measure": math.nan}, "measure"),
    ],
)
def test_every_part_of_a_decision_counts(change, what):
    replayed = replace(OUTPUT, decision=replace(DECISION, **change))
    assert [name for name, _, _ in outputs(OUTPUT, replayed)] == [what]


@pytest.mark.parametrize("drive", [Drive(0.9, 0.1), Drive(1.0, 0.2), Drive(1.0, 0.1, 3.0)])
def test_what_was_sent_counts(drive):
    assert len(list(outputs(OUTPUT, replace(OUTPUT, drive=drive)))) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"drive": None},
        {"drive": Drive(1.0, 0.2)},
        {"distance_m": 1.0},
        {"error_m": 0.0},
        {"angle_rad": 1.0},
        {"reason": ""},
    ],
)
def test_every_part_of_an_answer_counts(change):
    assert len(list(guidances(GUIDANCE, replace(GUIDANCE, **change)))) == 1


def test_it_reads_as_a_sentence():
    found = Difference(4.64, 184, "winner", Source.NAVIGATION, Source.SAFETY)
    assert found.sentence() == "scan 184, 4.640 s: winner: recorded navigation, replayed safety"
    assert "recorded 'a', replayed 'b'" in Difference(0.0, 0, "reason", "a", "b").sentence()
    assert "recorded nobody" in Difference(0.0, 0, "winner", None, Source.SAFETY).sentence()
