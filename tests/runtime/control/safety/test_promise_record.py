"""What a source has kept of its promises."""

import cmath

import numpy as np
import pytest

from wallride.runtime.control.perception.motion.own_motion import DrivenPlace
from wallride.runtime.control.safety.promise_record import KEPT_S, LEAST_MARGIN_M, LEFT, NO_PROMISES, TAKEN_BACK

AHEAD_M = np.arange(0.0, 6.0, 0.1) + 0j


def place(number, speed_mps=3.0, beside_m=0.0):
    """Return the car on a straight way at a scan."""
    way_m = 0.025 * number * speed_mps
    return DrivenPlace(0.025 * number, way_m + 1j * beside_m * way_m, 1 + 0j, 0.0, way_m)


def kept(scans, speed_mps=3.0, record=NO_PROMISES):
    for number in range(scans):
        here = place(number, speed_mps)
        record = record.after(here, here.in_frame_m(AHEAD_M), 0.02)
        assert not record.reason
    return record, here


def test_promises_are_believed_after_a_time_and_a_way():
    assert not kept(round(KEPT_S / 0.025))[0].trusts(place(19))
    record, here = kept(24)
    assert record.trusts(here)


def test_a_standing_car_has_kept_nothing():
    record, here = kept(80, speed_mps=0.1)
    assert not record.trusts(here)


def test_a_source_that_drives_beside_its_own_path_has_left_it():
    record, _ = kept(40)
    for number in range(40, 60):
        here = place(number)._replace(at_m=0.025 * number * 3.0 - 0.04j * (number - 39))
        record = record.after(here, 0.025 * number * 3.0 + AHEAD_M, 0.02)
        if record.reason:
            break
    assert record.reason == LEFT
    assert not record.trusts(here)
    assert record.refused == 1
    assert record.margin_m(0.0) > 0.05


def test_a_path_that_turns_away_little_by_little_is_taken_back():
    record, here = kept(40)
    for number in range(40, 60):
        here = place(number)
        record = record.after(here, here.in_frame_m(AHEAD_M * cmath.exp(0.03j * (number - 40))), 0.02)
        if record.reason:
            break
    assert record.reason == TAKEN_BACK
    assert number < 55


def test_the_noise_of_a_pose_takes_nothing_back():
    rng, record = np.random.default_rng(1), kept(40)[0]
    for number in range(40, 140):
        here = place(number)
        noisy = AHEAD_M * cmath.exp(1j * rng.normal(0.0, 0.01)) + 1j * rng.normal(0.0, 0.01)
        record = record.after(here, here.in_frame_m(noisy), 0.02)
        assert not record.reason
    assert record.trusts(here)


@pytest.mark.parametrize(("shift_m", "every", "trusted"), [(0.16, 40, True), (0.16, 2, False), (0.3, 40, False)])
def test_a_pose_that_is_corrected_at_once_widens_the_margin_over_both_paths(shift_m, every, trusted):
    record, aside_m = kept(40)[0], 0.0
    for number in range(40, 60):
        line_m = shift_m * (1 + (number - 40) // every)
        here = place(number)._replace(at_m=0.025 * number * 3.0 + 1j * aside_m)
        back_m = AHEAD_M + 1j * (line_m - (line_m - aside_m) * np.exp(-2.0 * AHEAD_M.real))
        record = record.after(here, here.at_m.real + back_m, 0.02)
        if record.reason:
            break
        assert record.margin_m(0.02) > LEAST_MARGIN_M + 0.01
        aside_m = line_m - (line_m - aside_m) * np.exp(-2.0 * 0.075)
    assert record.trusts(here) == trusted
    assert (record.reason == "") == trusted


@pytest.mark.parametrize(
    ("speed_mps", "bend_per_m", "reason"), [(6.0, 0.05, ""), (2.0, 0.05, ""), (2.0, 0.25, TAKEN_BACK)]
)
def test_what_the_odometry_errs_takes_no_straight_path_back(speed_mps, bend_per_m, reason):
    record, _ = kept(40, speed_mps)
    for number in range(40, 100):
        straight, bent_m = place(number, speed_mps), 0.025 * (number - 40) * speed_mps
        turn = cmath.exp(1j * bend_per_m * bent_m)
        at_m = straight.at_m - bent_m + (turn - 1.0) / (1j * bend_per_m)
        here = straight._replace(at_m=at_m, turn=turn)
        record = record.after(here, here.in_frame_m(AHEAD_M), 0.1)
        if record.reason:
            break
    assert record.reason == reason


def test_a_promise_is_placed_where_its_own_scan_puts_the_car():
    record, here = kept(40)
    put = here._replace(at_m=here.at_m + 0.04j, turn=cmath.exp(0.1j))
    given = record.corrected(put).given
    assert given[:-1] == record.given[:-1]
    assert given[-1].here == put
    assert put.in_base_m(given[-1].path_m) == pytest.approx(AHEAD_M)
    assert record.corrected(place(38)._replace(turn=1j)) is record


def test_after_a_gap_the_source_begins_anew():
    record, _ = kept(60)
    here = place(67)
    record = record.after(here, here.in_frame_m(AHEAD_M), 0.02)
    assert not record.trusts(here)


def test_what_was_missed_widens_the_margin_and_fades():
    record, _ = kept(40)
    wide = record._replace(off_m=0.2)
    assert wide.margin_m(0.0) == pytest.approx(0.21)
    for number in range(40, 400):
        here = place(number)
        wide = wide.after(here, here.in_frame_m(AHEAD_M), 0.02)
    assert wide.margin_m(0.0) < 0.06
