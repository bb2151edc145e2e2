"""Judging changes nothing: the mux alone commits what a command that was sent leaves in the law."""

import re
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

import wallride.runtime
from tests.own_laws import EASY
from tests.runtime.in_earnest import judged
from tests.runtime.observed import HandClock, scan_at
from tests.runtime.reachable import reachable
from wallride.drivers.api import Drive, MotorState
from wallride.runtime.arbitration.command import DriveCommand, QueueEntry, Source, SpeedLimit, arbitrate
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.safety.swept import SweptAssessment
from wallride.runtime.settings.tree import load_settings
from wallride.sim.virtual.devices import ranges_between_walls

SCANS = 12
COMMIT = {"tasks/mux.py", "rehearsal.py", "control/own_laws/guard.py"}
"""The mux, a rehearsal in laws of its own, and what forwards their commit."""


def assessments(seed, *wanted):
    """Yield what a law makes of a fast approach to a wall, with silence ahead now and then, judged in earnest."""
    rng, clock = np.random.default_rng(seed), HandClock()
    settings = load_settings(None, wanted)
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car, clock)
    speed_mps, ahead_m = rng.uniform(1.0, 4.0), rng.uniform(1.5, 3.0)
    for step in range(SCANS):
        clock.now_s += 0.025
        way_m = step * 0.025 * speed_mps
        ranges_m = ranges_between_walls(rng.uniform(0.5, 1.0), 1.0, max(0.4, ahead_m - way_m)).astype(np.float32)
        if rng.random() < 0.4:
            ranges_m[500 : 500 + rng.integers(20, 160)] = np.nan
        assessment = laws.look(scan_at(clock(), ranges_m), MotorState(clock(), speed_mps, way_m, 0.0))
        yield assessment, rng
        judged(assessment, speed_mps, rng.uniform(-0.3, 0.3))
        laws.learn()


def questions(rng):
    for speed_mps in (rng.uniform(0.5, 4.0), rng.uniform(0.5, 4.0), -0.4, 0.0):
        yield float(speed_mps), float(rng.uniform(-0.34, 0.34))


@pytest.mark.parametrize("seed", range(6))
def test_a_question_leaves_no_trace_and_is_answered_as_in_earnest(seed):
    for assessment, rng in assessments(seed):
        assert isinstance(assessment, SweptAssessment)
        before = reachable(assessment)
        for drive in questions(rng):
            answers = assessment.ask(*drive), assessment.ask(*drive)
            assert repr(answers[0]) == repr(answers[1])
            assert reachable(assessment) == before
        assert repr(assessment.ask(2.0, 0.1)) == repr(judged(assessment, 2.0, 0.1))
        assert reachable(assessment) != before, "in earnest it leaves one"


@pytest.mark.parametrize("law", ["swept", "report", EASY])
@pytest.mark.parametrize("seed", range(6))
def test_a_judge_changes_no_memory_and_answers_alike(seed, law, law_file):
    remembered = 0
    for assessment, rng in assessments(seed, f"safety.method={law if law != EASY else law_file(law)}"):
        for drive in questions(rng):
            memory = assessment.memory
            before = reachable(memory)
            answers = {repr(assessment.judge(*drive, memory)) for _ in range(5)}
            assert len(answers) == 1
            assert assessment.memory is memory
            assert reachable(memory) == before
            remembered += assessment.judge(*drive, memory)[1] is not memory
    assert (remembered > 0) == (law != "report"), "the report's law remembers nothing"


@pytest.mark.parametrize("seed", range(6))
def test_arbitrating_commits_nothing_and_hands_over_what_the_command_leaves(seed):
    changed = 0
    for assessment, rng in assessments(seed):
        before = assessment.memory
        wish = DriveCommand(Source.TELEOP, Drive(*next(questions(rng))), None, "by hand")
        live: list[QueueEntry] = [SpeedLimit(Source.SAFETY, assessment, 1.0), wish]
        for _ in range(3):
            _, ((judge, memory),) = arbitrate(live, frozenset(), [Source.SAFETY, Source.TELEOP])
            assert judge is assessment
            assert assessment.memory is before
        assert repr(memory) == repr(assessment.judge(*astuple(wish.drive)[:2], before)[1])
        changed += memory is not before
    assert changed


def test_a_question_leaves_no_trace_under_an_own_law(law_file):
    for assessment, rng in assessments(3, f"safety.method={law_file(EASY)}"):
        before = reachable(assessment)
        for drive in questions(rng):
            assessment.ask(*drive)
        assert reachable(assessment) == before


def test_the_mux_alone_commits():
    root = Path(wallride.runtime.__file__).parent
    commits = re.compile(r"\.(commit\(|memory = )")
    found = {str(path.relative_to(root)) for path in root.rglob("*.py") if commits.search(path.read_text())}
    assert found - {"control/safety/swept.py"} == COMMIT
