"""Reading LaserScan from outside: geometry, values that are no distance, damaged bytes."""

import math
import random
import struct

import numpy as np
import pytest

from wallride.runtime.ros.cdr import CdrWriter
from wallride.runtime.ros.laser_scan import read_laser_scan
from wallride.runtime.wire.ingress import MAX_INCOMING_B
from wallride.runtime.wire.teleop import Malformed


def message(ranges_m=(1.0, 2.0, 3.0), first_rad=-0.1, last_rad=0.1, step_rad=0.1, ray_s=0.001, strengths=0, **other):
    out = CdrWriter()
    out.put("iI", other.get("seconds", 1_764_000_000), 500)
    out.text("laser_frame")
    out.put("fffffff", first_rad, last_rad, step_rad, ray_s, 0.1, 0.1, other.get("far_m", 12.0))
    out.sequence("f", np.array(ranges_m))
    out.sequence("f", np.zeros(strengths))
    return out.done()


def test_a_scan_has_its_beams_angles_and_the_time_of_the_last_beam():
    scan = read_laser_scan(message(strengths=3))
    assert scan.ranges_m.tolist() == [1.0, 2.0, 3.0]
    assert (scan.angle_min_rad, scan.angle_step_rad) == pytest.approx((-0.1, 0.1))
    assert scan.stamp_ns == pytest.approx(1_764_000_000 * 10**9 + 500 + 2_000_000, abs=10)


def test_a_descending_scan_is_turned_round():
    scan = read_laser_scan(message((1.0, 2.0, 4.0), first_rad=0.2, last_rad=0.0, step_rad=-0.1))
    assert scan.ranges_m.tolist() == [4.0, 2.0, 1.0]
    assert (scan.angle_min_rad, scan.angle_step_rad, scan.ray_s) == pytest.approx((0.0, 0.1, -0.001))


def test_angle_max_may_be_one_step_after_the_last_beam():
    assert read_laser_scan(message(last_rad=0.2)).ranges_m.size == 3


def test_what_is_no_distance_is_nan():
    values = (math.inf, -math.inf, math.nan, 0.0, 0.05, 13.0, -1.0, 5.0)
    scan = read_laser_scan(message(values, first_rad=0.0, last_rad=0.7))
    assert np.isnan(scan.ranges_m).tolist() == [True] * 7 + [False]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"last_rad": 0.5}, "angle_max contradicts 3 beams"),
        ({"step_rad": 0.0}, "angle_increment of 0"),
        ({"first_rad": math.nan}, "no numbers"),
        ({"strengths": 2}, "2 intensities"),
        ({"ranges_m": (1.0,)}, "a scan of 1 beams"),
        ({"far_m": math.inf}, "none of a lidar"),
        ({"ray_s": math.nan}, "none of a lidar"),
    ],
)
def test_a_contradiction_is_refused_by_name(changes, words):
    with pytest.raises(Malformed, match=words):
        read_laser_scan(message(**changes))


def test_too_long_or_of_another_encoding_is_refused():
    with pytest.raises(Malformed, match="too many"):
        read_laser_scan(bytes(MAX_INCOMING_B + 1))
    with pytest.raises(Malformed, match="not CDR"):
        read_laser_scan(b"\0\0\0\0" + message()[4:])


def test_damaged_bytes_raise_nothing_else():
    whole, luck = message(strengths=3), random.Random(5)
    for _ in range(3000):
        damaged = bytearray(whole[: luck.randrange(len(whole) + 1)])
        for _ in range(min(len(damaged), luck.randrange(4))):
            damaged[luck.randrange(len(damaged))] = luck.randrange(256)
        try:
            read_laser_scan(bytes(damaged))
        except Malformed:
            continue


def test_a_length_of_4_billion_is_refused_without_being_used():
    whole = bytearray(message())
    struct.pack_into("<I", whole, 12, 0xFFFFFFFF)
    with pytest.raises(Malformed, match="do not fit"):
        read_laser_scan(bytes(whole))
