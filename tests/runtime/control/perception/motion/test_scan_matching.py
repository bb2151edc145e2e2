"""Scan matching corrects heading and side of the odometry, and leaves to it what the scene does not show."""

import numpy as np
import pytest

from tests.runtime.control.scans import BEARING_RAD, CAR, see
from wallride.drivers.api import Scan
from wallride.runtime.control.perception.motion.scan_matching import ScanPose, match, surfaces_of
from wallride.runtime.control.perception.view import ViewCache
from wallride.sim.virtual.devices import BEAMS, STEP_RAD


def room(pose, *, half_width_m=1.0, ends_m=(-4.0, 6.0), noise_m=0.01, seed=1):
    """Return the view from a pose (x, y, yaw) in a rectangular room along x."""
    x_m, y_m, yaw_rad = pose
    at = complex(x_m, y_m) + CAR.lidar_x_m * np.exp(1j * yaw_rad)
    cos, sin = np.cos(BEARING_RAD + yaw_rad), np.sin(BEARING_RAD + yaw_rad)
    with np.errstate(divide="ignore"):
        to_side = np.where(sin > 0, (half_width_m - at.imag) / sin, (-half_width_m - at.imag) / sin)
        to_end = np.where(cos > 0, (ends_m[1] - at.real) / cos, (ends_m[0] - at.real) / cos)
    ranges_m = np.minimum(np.abs(to_side), np.abs(to_end)) + np.random.default_rng(seed).normal(0, noise_m, 1081)
    ranges_m[ranges_m > 25] = np.nan
    return see(ranges_m)


@pytest.mark.parametrize(("shift", "yaw_rad"), [(0.3 + 0.05j, 0.12), (0.2 - 0.1j, -0.2), (0j, 0.0)])
def test_a_wrong_heading_and_side_are_corrected(shift, yaw_rad):
    guess = ScanPose(shift + 0.05j, yaw_rad + 0.06)
    view = room((shift.real, shift.imag, yaw_rad), seed=2)
    found, sure = match(view, surfaces_of(room((0, 0, 0))), guess)
    assert sure
    assert found.yaw_rad == pytest.approx(yaw_rad, abs=0.005)
    assert found.at_m.imag == pytest.approx(shift.imag, abs=0.015)
    assert found.at_m.real == pytest.approx(shift.real, abs=0.03)


def test_a_lidar_of_360_beams_is_enough():
    def coarse(pose, seed):
        fine = room(pose, seed=seed).scan
        return ViewCache(CAR).see(
            Scan(0.0, 0.0, fine.angle_min_rad, 3 * STEP_RAD, 0.02, 30.0, fine.ranges_m[::3].copy(), 0)
        )

    found, sure = match(coarse((0.2, -0.1, 0.1), 2), surfaces_of(coarse((0, 0, 0), 1)), ScanPose(0.2 + 0j, 0.05))
    assert sure
    assert found.yaw_rad == pytest.approx(0.1, abs=0.005)


def test_along_a_bare_corridor_the_odometry_decides():
    endless = {"ends_m": (-60.0, 60.0)}
    found, sure = match(
        room((0.3, 0.0, 0.0), seed=2, **endless), surfaces_of(room((0, 0, 0), **endless)), ScanPose(0.3)
    )
    assert found.at_m.real == pytest.approx(0.3, abs=0.02)
    assert sure


def test_a_scene_that_does_not_fit_or_is_not_seen_corrects_nothing():
    before = surfaces_of(room((0, 0, 0)))
    assert match(room((0, 0, 0), half_width_m=2.0, ends_m=(-9.0, 12.0)), before, ScanPose()) is None
    nothing = see(np.full(BEAMS, np.nan))
    assert match(nothing, before, ScanPose()) is None
    assert match(room((0, 0, 0)), surfaces_of(nothing), ScanPose()) is None


def test_a_round_room_shows_no_heading():
    """All ranges are alike: the car may have turned by any angle."""
    view = see(np.full(BEAMS, 3.0))
    _, sure = match(view, surfaces_of(view), ScanPose())
    assert not sure


def test_a_single_wall_ahead_shows_no_motion_aside():
    view = room((0, 0, 0), half_width_m=60.0, ends_m=(-60.0, 4.0))
    _, sure = match(view, surfaces_of(view), ScanPose())
    assert not sure


def test_a_scene_that_fits_by_a_third_is_another_one():
    def half_open(from_beam, to_beam):
        ranges_m = room((0, 0, 0)).scan.ranges_m.copy()
        ranges_m[from_beam:to_beam] *= 1.4
        return see(ranges_m)

    before = surfaces_of(room((0, 0, 0)))
    assert match(half_open(500, 620), before, ScanPose()) is not None
    assert match(half_open(150, 800), before, ScanPose()) is None
