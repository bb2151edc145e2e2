"""A turn on a grid: where a sample goes, which one is kept, and the car's own motion taken out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.drivers.turning.grid import COUNTS, SPARE, STILL, Motion, Mount, cells_for, resample
from wallride.drivers.turning.turns import Turn

NEAREST_M, FARTHEST_M = 0.15, 12.0


def turn_of(deg: list[float], range_m: list[float], ago_s: list[float] | None = None) -> Turn:
    ago = np.zeros(len(deg)) if ago_s is None else np.array(ago_s)
    return Turn(np.array(deg, np.float64), np.array(range_m, np.float64), ago, 0.0, 0.0, 0.1)


def scan_of(turn: Turn, motion: Motion = STILL, mount: Mount | None = None, count: int = 360) -> np.ndarray:
    return resample(turn, motion, mount or Mount(), count, NEAREST_M, FARTHEST_M)


def test_clockwise_degrees_become_bearings_to_the_left():
    ranges_m = scan_of(turn_of([0.0, 90.0, 270.0, 180.0], [1.0, 2.0, 3.0, 4.0]))
    assert ranges_m[180] == 1.0  # ahead
    assert ranges_m[90] == 2.0  # 90 degrees clockwise: right
    assert ranges_m[270] == 3.0
    assert ranges_m[0] == 4.0  # behind
    assert np.isnan(ranges_m).sum() == 356
    assert ranges_m.dtype == np.float32
    assert not ranges_m.flags.writeable


def test_the_mounting_turns_the_scan():
    turn = turn_of([0.0, 90.0], [1.0, 2.0])
    assert scan_of(turn, mount=Mount(yaw_rad=math.pi))[0] == 1.0
    assert scan_of(turn, mount=Mount(yaw_rad=math.pi / 2))[270] == 1.0
    assert scan_of(turn, mount=Mount(upside_down=True))[270] == 2.0


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -2.5, math.pi])
@pytest.mark.parametrize("upside_down", [False, True])
def test_a_turn_is_cut_behind_the_car(yaw_rad, upside_down):
    mount = Mount(yaw_rad, upside_down)
    bearing_rad = mount.bearing_rad(np.array([mount.cut_deg]))[0]
    assert abs(math.remainder(bearing_rad - math.pi, math.tau)) < 1e-9


@given(
    st.lists(st.tuples(st.floats(0, 359.99), st.floats(0.2, 11.9)), min_size=1, max_size=60), st.sampled_from(COUNTS)
)
def test_the_nearest_return_of_a_cell_is_kept_and_none_is_lost(points, count):
    deg, range_m = [list(part) for part in zip(*points, strict=True)]
    ranges_m = scan_of(turn_of(deg, range_m), count=count)
    assert ranges_m.shape == (count,)
    assert np.nanmin(ranges_m) == np.float32(min(range_m))
    for one_deg, one_m in points:
        cell = round((math.pi - math.radians(one_deg)) / (math.tau / count))
        near = [ranges_m[(cell + step) % count] for step in (-1, 0, 1)]
        assert np.nanmin(near) <= np.float32(one_m)


@pytest.mark.parametrize("bad", [math.nan, 0.1, 12.1, math.inf, -1.0])
def test_what_is_out_of_range_is_no_information(bad):
    assert np.isnan(scan_of(turn_of([0.0], [bad]))).all()


@pytest.mark.parametrize("per_turn", [200, 363, 400, 571, 714, 800, 985, 3200])
def test_evenly_spaced_samples_leave_no_cell_empty(per_turn):
    count = cells_for(per_turn)
    assert count
    assert count * SPARE <= per_turn
    deg = (np.arange(per_turn) * 360.0 / per_turn + 0.123) % 360.0
    assert not np.isnan(scan_of(turn_of(deg.tolist(), [2.0] * per_turn), count=count)).any()


def test_a_turn_of_too_few_samples_has_no_grid():
    assert cells_for(150) == 0


@pytest.mark.parametrize(
    "motion", [Motion(3.0, 0.0, 0.0), Motion(2.0, 0.3, 1.5), Motion(-1.0, 0.0, -2.0), Motion(0.0, 0.0, 3.0)]
)
def test_the_cars_own_motion_is_taken_out(motion):
    """A pole is measured from the pose of the time; the scan shows where it is from the pose at the end."""
    end_s, turn_s = 0.0, 0.1
    poles = np.array([2 + 1j, 3 - 2j, -1.5 + 0.5j, 4 + 0j])
    deg, range_m, ago_s = [], [], []
    for pole in poles:
        for ago in np.linspace(turn_s, 0.0, 2001):
            yaw_rad = -motion.yaw_rate_radps * ago
            velocity = complex(motion.x_mps, motion.y_mps)
            place = -velocity * ago * (np.exp(0.5j * yaw_rad) if yaw_rad else 1.0)
            seen = (pole - place) * np.exp(-1j * yaw_rad)
            head_deg = 180.0 + 360.0 * (turn_s - ago) / turn_s
            if abs((math.degrees(-np.angle(seen)) - head_deg + 180) % 360 - 180) < 0.1:
                deg.append(math.degrees(-np.angle(seen)) % 360)
                range_m.append(abs(seen))
                ago_s.append(ago)
                break
    ranges_m = scan_of(turn_of(deg, range_m, ago_s), motion, count=720)
    for pole in poles:
        cell = round((np.angle(pole) + math.pi) / (math.tau / 720)) % 720
        near = ranges_m[[(cell + k) % 720 for k in (-1, 0, 1)]]
        assert np.nanmin(np.abs(near - abs(pole))) < 0.002, (pole, near, end_s)
