"""Which command answers which scan: by its steering, never by its time alone."""

import pytest

from wallride.sim.bench.answers import onsets, pair, percentiles_ms
from wallride.sim.bench.devices import MotorCommand
from wallride.sim.bench.rig import SentScan

FREE, BLOCKED = False, True
BEFORE = (0.05, True, 490)


def scans(*kinds):
    return [SentScan(0.1 * i, 0.1 * i + 0.001, kind) for i, kind in enumerate(kinds, 1)]


def told(*commands):
    return [MotorCommand(at_s, moving, servo) for at_s, moving, servo in commands]


def test_the_answer_is_the_first_command_that_steers_otherwise():
    commands = told((0.05, True, 500), (0.102, True, 500), (0.111, True, 520), (0.115, True, 520))
    answers = pair(scans(FREE), commands)
    assert answers.latency_s == [pytest.approx(0.010)]
    assert answers.any_s == [pytest.approx(0.001)]


def test_a_repetition_answers_nothing():
    answers = pair(scans(FREE), told((0.05, True, 500), (0.11, True, 500)))
    assert (answers.latency_s, answers.unanswered) == ([], 1)


def test_an_answer_after_the_next_scan_is_none():
    answers = pair(scans(FREE, FREE), told((0.05, True, 500), (0.201, True, 520)))
    assert answers.unanswered == 1
    assert answers.latency_s == [pytest.approx(0.0, abs=1e-9)]


def test_what_came_before_any_command_is_not_judged():
    assert pair(scans(FREE), told((0.11, True, 500))).unanswered == 1


def test_a_stop_after_a_board_is_timed_from_the_first_blocked_scan():
    commands = told(BEFORE, (0.15, True, 500), (0.205, False, 510), (0.305, False, 520))
    found = onsets(scans(FREE, BLOCKED, BLOCKED, FREE), commands)
    assert (found.onsets, found.slipped) == (1, 0)
    assert found.stops_s == [pytest.approx(0.004)]


def test_a_repeated_older_command_has_not_slipped():
    commands = told(BEFORE, (0.15, True, 500), (0.202, True, 500), (0.205, False, 510))
    assert onsets(scans(FREE, BLOCKED, FREE), commands).slipped == 0


@pytest.mark.parametrize("late", [((0.203, True, 520), (0.205, False, 510)), ((0.203, False, 510), (0.205, True, 510))])
def test_a_moving_command_from_a_blocked_scan_has_slipped(late):
    assert onsets(scans(FREE, BLOCKED, FREE), told(BEFORE, (0.15, True, 500), *late)).slipped == 1


def test_an_onset_that_a_held_up_car_meets_proves_nothing():
    """It answers the scan before the board under it."""
    found = onsets(scans(FREE, BLOCKED, FREE), told(BEFORE, (0.202, True, 500), (0.204, False, 510)))
    assert (found.onsets, found.slipped) == (0, 0)


def test_an_onset_before_a_standing_car_proves_nothing():
    assert onsets(scans(FREE, BLOCKED), told(BEFORE, (0.15, False, 500), (0.205, False, 510))).onsets == 0


def test_percentiles_of_nothing_are_nothing():
    assert percentiles_ms([]) == {}
    assert percentiles_ms([0.001, 0.003])["p50"] == pytest.approx(2.0)


def test_a_write_in_which_the_car_ran_already_counts_as_long_as_usual():
    usual = [SentScan(0.1 * i, 0.1 * i + 0.001, FREE) for i in range(1, 4)]
    interrupted = SentScan(0.4, 0.409, FREE)  # the car had the core, and answered before the call returned
    commands = told(*((0.1 * i + 0.005, True, 500 + i) for i in range(5)))
    assert pair([*usual, interrupted], commands).latency_s == [pytest.approx(0.004)] * 4
