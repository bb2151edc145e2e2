"""The lidar's displacement between two scans of simulated rooms: found without a guess, where the walls tell it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.control.perception.test_plausibility import Room
from wallride.drivers.api import Health
from wallride.drivers.turning.grid import Motion, Mount
from wallride.drivers.turning.samples import HeadSamples
from wallride.drivers.turning.stream import StreamFacts, Turning, TurnStream
from wallride.runtime.control.perception.scan_displacement import corrected_anew, displacement, patches_of
from wallride.runtime.control.perception.scan_shift import votes


def two_scans(world, way_m, turn_rad, *, noise_m=0.01, seed=1):
    """Return the scans before and after a way along an arc, and the lidar's true shift in its first frame."""
    room = Room(world, seed=seed, noise_m=noise_m)
    room.step(0.0, told=0.0)
    before, at = room.last, room.pose.ahead(room.lidar.mount_x_m, 0.0)
    yaw_rad, steps = room.pose.yaw_rad, 4
    steering_rad = math.atan(turn_rad * 0.33 / way_m) if way_m else 0.0
    for _ in range(steps if way_m else 0):
        room.step(way_m / steps / 0.025, steering_rad=steering_rad)
    if not way_m:
        room.step(0.0, told=0.0)
    now = room.pose.ahead(room.lidar.mount_x_m, 0.0)
    shift_m = complex(now.x_m - at.x_m, now.y_m - at.y_m) * np.exp(-1j * yaw_rad)
    return before, room.last, shift_m, room.pose.yaw_rad - yaw_rad


@pytest.mark.parametrize("world", ["inside_corner", "loop", "u_turn", "dead_end", "cluttered"])
@pytest.mark.parametrize("way_m", [0.08, 0.2])
@pytest.mark.parametrize("turn_rad", [0.0, 0.08])
@pytest.mark.parametrize(("noise_m", "within_m"), [(0.005, 0.01), (0.02, 0.025)])
def test_a_shift_is_found_without_a_guess(world, way_m, turn_rad, noise_m, within_m):
    before, after, shift_m, turned_rad = two_scans(world, way_m, turn_rad, noise_m=noise_m)
    found = displacement(patches_of(before), patches_of(after), turned_rad + 0.03)
    assert found is not None
    assert abs(found.shift_m - shift_m) < within_m
    assert abs(found.turn_rad - turned_rad) < within_m


@pytest.mark.parametrize("yaw_rad", [1.6, -1.6, math.pi])
def test_a_turned_lidar_shows_the_same_way_in_another_direction(yaw_rad):
    before, after, shift_m, _ = two_scans("cluttered", 0.1, 0.0)
    turned = [replace(scan, angle_min_rad=scan.angle_min_rad + yaw_rad) for scan in (before, after)]
    found = displacement(patches_of(turned[0]), patches_of(turned[1]), 0.0)
    assert found is not None
    assert abs(found.shift_m - shift_m * np.exp(1j * yaw_rad)) < 0.012


@pytest.mark.parametrize("world", ["straight", "corridor"])
def test_parallel_walls_tell_nothing_of_the_way_along_them(world):
    before, after, *_ = two_scans(world, 0.1, 0.0)
    found = displacement(patches_of(before), patches_of(after), 0.0)
    assert found is not None
    (along, _), (_, across) = found.information
    assert along < 1e-3 * across


def test_a_standing_car_has_no_shift():
    before, after, *_ = two_scans("cluttered", 0.0, 0.0)
    found = displacement(patches_of(before), patches_of(after), 0.05)
    assert found is not None
    assert abs(found.shift_m) < 0.006
    assert abs(found.turn_rad) < 0.006


def test_scans_of_two_sensors_are_not_compared():
    before, *_ = two_scans("cluttered", 0.0, 0.0)
    other = replace(before, angle_step_rad=2 * before.angle_step_rad, ranges_m=before.ranges_m[::2])
    assert displacement(patches_of(before), patches_of(other), 0.0) is None


def test_a_lidar_that_sees_nothing_is_not_compared():
    before, *_ = two_scans("cluttered", 0.0, 0.0)
    nothing = patches_of(replace(before, ranges_m=np.full_like(before.ranges_m, np.nan)))
    assert not nothing.flat.any()
    assert displacement(patches_of(before), nothing, 0.0) is None
    assert displacement(nothing, patches_of(before), 0.0) is None


class Samples:
    """Decodes each chunk to the turn that a standing lidar measures in a square room."""

    behind = 0

    def __init__(self, mount):
        self._deg = (mount.cut_deg + 0.5 * np.arange(720)) % 360.0
        bearing_rad = mount.bearing_rad(self._deg)
        self._range_m = 2.0 / np.maximum(np.abs(np.cos(bearing_rad)), np.abs(np.sin(bearing_rad)))

    def feed(self, _chunk):
        return HeadSamples(self._deg, self._deg, self._range_m)

    def reset(self):
        """Nothing is left of a chunk."""


def corrected_scan(mount, motion):
    """Return the scan that a driver makes of such turns when it is told this motion."""
    scans = []
    facts = StreamFacts(Samples(mount), 0.1 / 720, 0.1, 10.0, "square room")
    stream = TurnStream(facts, Turning(mount, 1.0, 0.0, lambda: motion), Health(), lambda: len(scans), scans.append)
    for number in range(5):
        stream.on_bytes(b"", 0.1 * (number + 1))
    return scans[-1]


@pytest.mark.parametrize("mount", [Mount(), Mount(0.7), Mount(upside_down=True), Mount(-2.0, upside_down=True)])
def test_what_a_driver_took_out_of_a_turn_can_be_replaced(mount):
    one, other = (corrected_scan(mount, motion) for motion in (Motion(1.0, 0.1, 0.8), Motion(0.3, 0.0, -0.4)))
    wanted = patches_of(other)
    assert one.correction is not None
    assert other.correction is not None
    wrong = displacement(wanted, patches_of(one), 0.0)
    found = displacement(wanted, corrected_anew(patches_of(one), one.correction, other.correction), 0.0)
    assert wrong is not None
    assert found is not None
    assert abs(wrong.shift_m) > 0.012
    assert abs(found.shift_m) < 0.004
    assert abs(found.turn_rad) < 0.004


@pytest.mark.parametrize("mount", [Mount(), Mount(upside_down=True)])
def test_a_stored_turn_stands_whatever_was_taken_out_of_it(mount):
    one, other = (corrected_scan(mount, motion) for motion in (Motion(1.0, 0.1, 0.8), Motion(0.3, 0.0, -0.4)))
    stands, moves = votes(one, other, (0.3, 0.0, 0.0), 0j, np.array([0.6, 1.0]), np.radians([-8.0, 0.0, 8.0])) or (0, 0)
    assert stands > 40
    assert moves < 5


def test_a_scan_of_which_no_motion_was_taken_out_has_no_votes():
    before, after, *_ = two_scans("cluttered", 0.2, 0.0)
    assert votes(before, after, (0.2, 0.0, 0.0), 0j, np.array([1.0]), np.array([0.0])) is None
