"""The compiled twins answer what the Python answers, and leave when the Python is no longer what they were made for."""

import math
import shutil
import sysconfig
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers import twin
from drivers.api import MotorState, Scan
from drivers.hokuyo.codec import checksum
from runtime import kernel
from runtime.car_settings import CarSettings
from runtime.control import movers, my_wall, perception
from runtime.control.ball import BallFollower
from runtime.control.ball_settings import BallSettings
from runtime.control.perception import Eyes
from runtime.control.prediction import Answers, Told
from runtime.control.swept import SweptGuard
from runtime.control.swept_settings import SweptSettings
from runtime.control.wall_track import WallTrack
from sim.beams import LidarSettings, scan
from sim.closed_loop import as_scan
from sim.pose import Pose, Twist
from sim.worlds import load_world

HEADER = Path(sysconfig.get_paths()["include"]) / "Python.h"
BEAMS, STEP_RAD = 1081, math.radians(0.25)
ROUNDING = 1e-9
"""Sines and sums are rounded differently; whatever is a choice (a beam, a yes or no) has to be the same."""


@pytest.fixture(scope="module")
def compiled():
    """Return the twins; the Python goes on answering."""
    found = kernel.use()
    answering = dict(twin._answering)
    twin.use({})
    if not found.functions:
        assert shutil.which("cc") is None or not HEADER.is_file(), found.words  # it could be had, and is broken
        pytest.skip(found.words)
    return {name: answering[name] for name in found.functions}


@pytest.fixture
def compared(compiled):
    """Let both answer everything, and compare; counts how often each was asked."""
    asked = Counter()

    def both(name):
        def answer(*given):
            by_python = twin.PLAIN[name](*given)
            asked[name] += 1
            assert_same(name, by_python, compiled[name](*given))
            return by_python

        return answer

    twin.use({name: both(name) for name in compiled})
    yield asked
    twin.use({})


def assert_same(name, one, other):
    if isinstance(one, tuple | list):
        assert type(one) is type(other), name
        assert len(one) == len(other), name
        for a, b in zip(one, other, strict=True):
            assert_same(name, a, b)
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype, name
        assert one.shape == other.shape, name
        exact = one.dtype.kind in "bi"
        np.testing.assert_allclose(other, one, rtol=0 if exact else ROUNDING, atol=0 if exact else ROUNDING)
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=ROUNDING, abs=ROUNDING, nan_ok=True), name
    else:
        assert one == other, name


class Drive:
    """Feeds scans to both laws of a car that drives by dead reckoning; asks about driving on and about backing out."""

    def __init__(self, side="left"):
        car = CarSettings()
        eyes = Eyes(car)
        self.guard = SweptGuard(SweptSettings(), car, eyes)
        self.follower = BallFollower(BallSettings(speed_mps=2.0, side=side), car, eyes)
        self.way_m = 0.0
        self.scans = 0

    def see(self, sweep, speed_mps=2.0, steering_rad=0.05):
        self.way_m += 0.025 * speed_mps
        motor = MotorState(
            sweep.stamp_s, speed_mps, self.way_m, steering_rad, 11.0, 0.0, 0.0, 30.0, "", timed_out=False, killed=False
        )
        outlook = self.guard.look(sweep, motor)
        guidance = self.follower.follow(sweep, motor)
        wish = guidance.drive
        if wish is not None:
            outlook.limit(wish.speed_mps, wish.steering_rad)
        for asked in ((4.0, 0.3), (1.0, -0.34), (-0.4, 0.2)):
            outlook.limit(*asked)
        self.scans += 1

    def see_ranges(self, ranges_m, **how):
        at_s = 0.025 * self.scans
        ranges_m = np.asarray(ranges_m, np.float32)
        self.see(Scan(at_s, at_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, ranges_m, self.scans), **how)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("world", ["l_turn", "corridor", "doorway", "outside_corner", "straight"])
def test_a_drive_gets_the_same_answers(compared, world, side):
    rng = np.random.default_rng(3)
    lidar = LidarSettings(noise_std_m=0.02, outlier_share=0.02, dirty_sectors=((-96.0, -93.0, 0.3), (40.0, 41.0, 0.2)))
    drive, geometry = Drive(side), load_world(world)
    for step in range(80):
        at_s = 0.025 * step
        pose = Pose(0.07 * step, rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2))
        drive.see(as_scan(scan(geometry, pose, Twist(2.0), at_s, rng, lidar), lidar, at_s, step))
    hot = {
        "look",
        "small_things",
        "thin_places",
        "solid_places",
        "any_nearer",
        "swept_touch",
        "wall_piece",
        "foreseen",
    }
    assert {name for name in hot if compared[name] < 60} == set()


def ranges(draw_seed):
    """Return ranges as a hostile room gives them: pieces of walls, poles, dirt, the car's own parts, silence, noise."""
    rng = np.random.default_rng(draw_seed)
    ranges_m = np.empty(BEAMS)
    edges = np.sort(rng.integers(0, BEAMS, rng.integers(1, 40)))
    for piece in np.split(np.arange(BEAMS), edges):
        nearest_m = rng.choice([0.05, 0.15, 0.3, 0.5, 0.8, 1.5, 3.0, 6.0, 20.0])
        ranges_m[piece] = nearest_m * (1 + rng.uniform(-0.01, 0.01) * np.arange(piece.size))
        if rng.random() < 0.2:
            ranges_m[piece] = rng.choice([math.nan, math.inf, 0.0, -1.0])
    ranges_m += rng.normal(0, rng.choice([0.0, 0.005, 0.03]), BEAMS)
    wild = rng.random(BEAMS) < 0.03
    ranges_m[wild] = rng.uniform(0.0, 10.0, np.count_nonzero(wild))
    return ranges_m


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), speed_mps=st.floats(-0.5, 4.0), steering_rad=st.floats(-0.34, 0.34))
def test_nonsense_gets_the_same_answers(compared, seed, speed_mps, steering_rad):
    for side in ("left", "right"):
        drive = Drive(side)
        for scan_number in range(7):  # the same room again and again, so that things are seen again
            drive.see_ranges(ranges(seed + scan_number // 5), speed_mps=speed_mps, steering_rad=steering_rad)


@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([1, 2, 3, 4, 5, 6, 7, 30, 400]),
    there=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-4.0, 4.0)),
)
def test_any_wall_is_seen_from_there_alike(compiled, seed, points, there):
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.choice([0.005, 0.05, 1.0]) * rng.normal(1.0, 1.0, (2, points)).cumsum(axis=1)
    wall = np.flatnonzero(rng.random(points) < rng.choice([0.3, 1.0]))
    if not wall.size:
        wall = np.array([points - 1])
    given_ = (x_m, y_m, wall, *there)
    assert_same("wall_around", twin.PLAIN["wall_around"](*given_), compiled["wall_around"](*given_))
    at_once = (x_m, y_m, wall, x_m[wall[0]], y_m[wall[0]], there[2])  # the rear axle in the wall
    assert_same("wall_around", twin.PLAIN["wall_around"](*at_once), compiled["wall_around"](*at_once))


@pytest.mark.parametrize("place", range(3))
def test_a_wall_is_seen_alike_from_where_is_no_number(compiled, place):
    there = [0.1, 0.2, 0.3]
    there[place] = math.nan
    given_ = (np.arange(9.0), np.ones(9), np.arange(9), *there)
    assert_same("wall_around", twin.PLAIN["wall_around"](*given_), compiled["wall_around"](*given_))


@settings(max_examples=300)
@given(
    seed=st.integers(0, 2**32),
    lidar=st.tuples(
        st.floats(-3.2, 3.2), st.sampled_from([-0.1, -0.02, 0.004, 0.02, 0.1, 1e-9, 1e-300, 0.0, math.nan])
    ),
    toward_rad=st.one_of(st.floats(-3.2, 3.2), st.sampled_from([1e300, -1e300, math.nan, math.inf])),
    near_m=st.sampled_from([1.0, 2.0, 3.0, math.nan, math.inf]),
)
def test_any_dark_is_enclosed_alike(compiled, seed, lidar, toward_rad, near_m):
    rng = np.random.default_rng(seed)
    beams = rng.choice([0, 1, 9, 100, 400])
    no_echo, solid = rng.random((2, beams)) < rng.choice([0.03, 0.3, 0.9], (2, 1))
    given_ = (no_echo, solid, rng.choice([0.5, 1.0, 2.5, math.nan], beams), *lidar, toward_rad, near_m)
    try:
        expected = twin.PLAIN["dark_around"](*given_)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        with pytest.raises(type(error)):
            compiled["dark_around"](*given_)
    else:
        assert compiled["dark_around"](*given_) is expected


SOME_RAD = st.one_of(st.floats(-0.4, 0.4), st.sampled_from([0.0, 0.1, 0.1 + 1e-7, 0.2]))
OUTLINE = (0.45, 0.05, 0.2)
MOTION = [2.0, 1.0, 0.1, 0.05, 3.2, 0.33, 4.0, 0.01, 1.0, 3.0]
"""How a car moves that takes its bend wider while it gains speed."""


def assert_swept_alike(compiled, *given_):
    try:
        with np.errstate(all="ignore"):
            expected = twin.PLAIN["swept_touch"](*given_)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        with pytest.raises(type(error)):
            compiled["swept_touch"](*given_)
    else:
        assert_same("swept_touch", expected, compiled["swept_touch"](*given_))


@settings(max_examples=300)
@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([0, 2, 3, 4, 30, 400]),
    way=st.tuples(SOME_RAD, st.floats(-0.5, 6.0)),
    car=st.tuples(
        st.floats(0.0, 8.0), st.sampled_from([1.0, -1.0]), SOME_RAD, st.floats(0.0, 0.3), st.floats(0.0, 9.0)
    ),
    grip=st.tuples(st.sampled_from([0.5, 2.0, 8.0, math.inf]), st.floats(0.0, 0.1), st.floats(-3.0, 3.0)),
    end_mps=st.sampled_from([0.0, 2.0, 8.0]),
)
def test_any_arc_is_swept_alike(compiled, seed, points, way, car, grip, end_mps):
    rng = np.random.default_rng(seed)
    room_m = rng.choice([0.3, 1.0, 3.0, 9.0])
    points_m = rng.uniform(-room_m, room_m, points) + 1j * rng.normal(0.0, rng.choice([0.1, 1.0]), points)
    if points > 4:
        points_m[rng.integers(0, points, 3)] = complex(*rng.choice([math.nan, math.inf, -math.inf, 1.0], 2))
    for places_m in (points_m, np.repeat(points_m, 2)[::2]):
        assert_swept_alike(compiled, *way, places_m, *OUTLINE, *car, 0.33, *grip, end_mps)


WALL = 1.0 + 1j * np.linspace(-0.5, 0.5, 41)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0])
@pytest.mark.parametrize("place", range(15))
def test_what_is_no_number_is_swept_alike(compiled, place, value):
    for numbers in ([0.2, 3.0, *OUTLINE, *MOTION], [0.1, 3.0, *OUTLINE, *MOTION[:8], 0.0, 0.0]):
        numbers[place] = value
        assert_swept_alike(compiled, *numbers[:2], WALL, *numbers[2:])


def test_a_standing_car_on_no_floor_is_swept_by_nobody(compiled):
    numbers = [0.2, 3.0, WALL, *OUTLINE, 0.0, *MOTION[1:6], -1.0, *MOTION[7:8], 0.0, 0.0]
    for of in (twin.PLAIN, compiled):
        with pytest.raises(ZeroDivisionError):
            of["swept_touch"](*numbers)


def test_a_way_without_end_is_swept_by_nobody(compiled):
    for length_m in (1e18, 1e300):
        with pytest.raises(MemoryError):
            compiled["swept_touch"](0.2, length_m, WALL, *OUTLINE, *MOTION)


@pytest.mark.parametrize("beams", [1, 2, 5])
def test_hardly_any_beam_gets_the_same_answers(compared, beams):
    drive = Drive()
    for ranges_m in (np.full(beams, 1.0), np.full(beams, math.nan), np.full(beams, 0.1)):
        drive.see_ranges(ranges_m)


@given(data=st.binary(max_size=300), flipped=st.integers(0, 10**6))
def test_any_bytes_are_joined_alike(compiled, data, flipped):
    lines = [bytes(0x30 + byte % 64 for byte in data[i : i + 64]) for i in range(0, len(data), 64)]
    regular = b"\n".join(line + bytes([checksum(line)]) for line in lines)
    broken = bytearray(regular)
    if broken:
        broken[flipped % len(broken)] ^= 1 + flipped % 255
    for sent in (data, regular, bytes(broken)):
        assert compiled["joined_rows"](sent) == twin.PLAIN["joined_rows"](sent)


@given(data=st.binary(max_size=300), flipped=st.integers(0, 10**6), head=st.sampled_from([0, 1, 2, 40, 41]))
def test_any_block_is_taken_apart_alike(compiled, data, flipped, head):
    lines = [bytes(0x30 + byte % 64 for byte in data[i : i + 64]) for i in range(0, len(data), 64)]
    summed = [line + bytes([checksum(line)]) for line in (b"99", b"0abc", *lines)]
    regular = b"\n".join([b"MD0000108000000".ljust(head, b"x")[:head], *summed])
    broken = bytearray(regular)
    if broken:
        broken[flipped % len(broken)] ^= 1 + flipped % 255
    for sent in (data, regular, bytes(broken), b"\n" + regular, regular[: flipped % 60]):
        assert compiled["scan_parts"](sent) == twin.PLAIN["scan_parts"](sent)
    if lines and head in {1, 2, 40}:
        assert compiled["scan_parts"](regular)[1:] == (b"99", b"0abc", b"".join(lines))


@given(samples=st.binary(max_size=60), beams=st.integers(0, 20), reverse=st.booleans())
def test_any_samples_are_decoded_alike(compiled, samples, beams, reverse):
    digits = bytes(0x30 + byte % 64 for byte in samples)
    for sent in (samples, digits, digits[: 3 * beams]):
        answers = [of["decode_samples"](sent, beams, 20, 30000, int(reverse)) for of in (twin.PLAIN, compiled)]
        assert_same("decode_samples", *answers)
        assert answers[1] is None or not answers[1].flags.writeable


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 3, 8, 9, 40, 300]),
    lidar=st.tuples(st.floats(-3.2, 3.2), st.sampled_from([-0.1, -0.02, 0.004, 0.0044, 0.1, 1e-9, 3.0])),
    pose=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-4.0, 4.0)),
)
def test_any_thin_places_are_found_alike(compiled, seed, beams, lidar, pose):
    rng = np.random.default_rng(seed)
    ranges_m = rng.choice([0.9, 1.0, 1.2, 2.0, 2.1, 4.9, 5.0, 9.0, math.nan], beams, p=[0.05] * 7 + [0.6, 0.05])
    solid, dirty = rng.random((2, beams)) < 0.2
    x_m, y_m = ranges_m * np.cos(np.arange(beams)), ranges_m * np.sin(np.arange(beams))
    for known in (None, dirty):
        given_ = (x_m, y_m, solid, ranges_m, known, *lidar, *pose)
        thin_m, lonely_m = twin.PLAIN["thin_places"](*given_)
        assert_same("thin_places", (thin_m, lonely_m), compiled["thin_places"](*given_))
    if lonely_m.size:
        before = tuple(thin_m + rng.normal(0.0, 0.02, thin_m.size) for _ in range(4))
        given_ = (lonely_m, before, *pose)
        assert_same("returned", twin.PLAIN["returned"](*given_), compiled["returned"](*given_))


def window(seed, beams):
    """Return what one scan shows of a window and what is known of it: the arrays that `evidence` wants."""
    rng = np.random.default_rng(seed)
    ranges_m = ranges(seed)[:beams]
    ranges_m[~((ranges_m > 0) & (ranges_m < math.inf))] = math.nan
    near_m = np.where(rng.random(beams) < 0.5, ranges_m + rng.normal(0.0, 0.06, beams), math.nan)
    own, rear = rng.random((2, beams)) < 0.4
    dirt, body, blind = rng.choice([0.0, 1.0, 0.3, 0.6, 0.95, rng.random()], (3, beams))
    return ranges_m, np.isnan(ranges_m), own, rear, near_m, dirt, body, blind


SHARE = st.floats(0.0, 1.0)


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 40, 41, 81, 161, 200, BEAMS]),
    shares=st.tuples(SHARE, SHARE, st.one_of(st.just(0.0), SHARE)),
)
def test_any_window_is_learnt_alike(compiled, seed, beams, shares):
    known = window(seed, beams)
    for scan_number in range(3):  # each learns on from what was learnt by Python
        given_ = (*window(seed + scan_number // 2, beams)[:4], *known[4:], *shares)
        before = [array.copy() for array in given_[:8]]
        learnt = twin.PLAIN["evidence"](*given_)
        assert_same("evidence", learnt, compiled["evidence"](*given_))
        assert_same("evidence", tuple(before), given_[:8])
        known = (*known[:4], *learnt)


@pytest.mark.parametrize("place", range(11))
def test_what_is_no_number_is_learnt_alike(compiled, place):
    for value in (math.nan, math.inf, -math.inf):
        given_ = [*window(5, BEAMS), 0.1, 0.3, 0.2]
        if place >= 8:
            given_[place] = value
        elif given_[place].dtype == np.float64:
            given_[place][::3] = value
        else:
            given_[place] = np.repeat(given_[place], 2)[::-2]  # backwards, and not side by side
        with np.errstate(invalid="ignore"):
            assert_same("evidence", twin.PLAIN["evidence"](*given_), compiled["evidence"](*given_))


def test_a_window_of_different_lengths_is_refused(compiled):
    for place in range(8):
        given_ = list(window(5, 30))
        given_[place] = given_[place][1:]
        with pytest.raises(ValueError, match="different lengths"):
            compiled["evidence"](*given_, 0.1, 0.3, 0.2)


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 40, BEAMS]),
    pose=st.tuples(*[st.one_of(st.floats(-50.0, 50.0), st.just(math.nan))] * 3),
)
def test_any_near_places_are_kept_alike(compiled, seed, beams, pose):
    ranges_m, _, solid, *_ = window(seed, beams)
    given_ = (ranges_m * np.cos(np.arange(beams)), ranges_m * np.sin(np.arange(beams)), solid, ranges_m, *pose)
    with np.errstate(invalid="ignore"):
        assert_same("near_places", twin.PLAIN["near_places"](*given_), compiled["near_places"](*given_))


def test_near_places_of_no_direction_or_of_different_lengths_are_refused(compiled):
    long_m, flags = np.ones(9), np.ones(9, np.bool_)
    for of in (twin.PLAIN, compiled):
        with pytest.raises(ValueError, match="math domain error"):
            of["near_places"](long_m, long_m, flags, long_m, 0.0, 0.0, math.inf)
    for place in range(4):
        arrays = [long_m, long_m, flags, long_m]
        arrays[place] = arrays[place][1:]
        with pytest.raises(ValueError, match="different lengths"):
            compiled["near_places"](*arrays, 0.0, 0.0, 0.0)


LEVELS = np.array([0.0, 0.25, 0.3, 0.31, 0.6, 0.61, 0.95, 0.96, 1.0, math.nan])


@given(
    seed=st.integers(0, 2**32),
    beams=st.sampled_from([0, 1, 2, 40, BEAMS]),
    highest=st.integers(1, LEVELS.size),
    bounds=st.sampled_from([(0.6, 0.3), (0.3, 0.6), (math.nan, 0.3), (0.6, math.nan)]),
)
def test_any_window_is_judged_alike(compiled, seed, beams, highest, bounds):
    rng = np.random.default_rng(seed)
    dirt, body, blind = rng.choice(LEVELS[:highest], (3, beams))
    for doubted in (None, rng.random(beams) < 0.8):
        before = tuple(rng.random((3, beams)) < rng.choice([0.0, 0.05]))
        for _ in range(3):  # the second time nothing has changed, but rows that grow
            given_ = (dirt, body, blind, doubted, before, *bounds)
            found, lost = twin.PLAIN["findings"](*given_)
            assert_same("findings", (found, lost), compiled["findings"](*given_))
            before = found or before


def test_findings_of_different_lengths_are_refused(compiled):
    flags = np.zeros(9, np.bool_)
    for place in range(7):
        arrays = [np.zeros(9), np.zeros(9), np.zeros(9), flags, flags, flags, flags]
        arrays[place] = arrays[place][1:]
        with pytest.raises(ValueError, match="different lengths"):
            compiled["findings"](*arrays[:4], tuple(arrays[4:]), 0.6, 0.3)
    for before in (None, (), (flags, flags), (flags, flags, None), [flags, flags, flags]):
        with pytest.raises(TypeError):
            compiled["findings"](*arrays[:3], None, before, 0.6, 0.3)


def test_a_lidar_whose_beams_are_one_has_no_thin_places(compiled):
    flags, ranges_m = np.zeros(9, np.bool_), np.ones(9)
    for of, step_rad in ((twin.PLAIN, 0.0), (compiled, 0.0), (twin.PLAIN, math.nan), (compiled, math.nan)):
        with pytest.raises((ValueError, ZeroDivisionError)):
            of["thin_places"](ranges_m, ranges_m, flags, ranges_m, None, -1.0, step_rad, 0.0, 0.0, 0.0)


ANGLE = st.floats(-1.5, 1.5)
RADII = tuple(np.linspace(0.3, 3.0, 10).tolist())


BOUND_S = st.floats(0.0, 0.2)


@given(
    told=st.lists(st.tuples(st.floats(8.7, 9.1), SOME_RAD), max_size=12).map(lambda told: tuple(sorted(told))),
    obeyed_s=st.sampled_from([-math.inf, 8.4, 8.9]),
    wire_s=st.tuples(BOUND_S, BOUND_S),
    motor=st.tuples(st.floats(8.8, 9.1), st.floats(-1.0, 8.0), SOME_RAD),
    servo_rad=st.floats(-0.4, 0.4),
    times=st.tuples(st.floats(8.9, 9.1), st.floats(0.0, 1.0), st.floats(-0.1, 0.4)),
    car=st.tuples(st.floats(0.2, 0.5), st.floats(-0.1, 0.1), st.floats(0.1, 10.0)),
)
def test_any_motion_is_foreseen_alike(compiled, told, obeyed_s, wire_s, motor, servo_rad, times, car):
    given_ = (told, (obeyed_s, *wire_s), *motor, servo_rad, *times, *car)
    assert_same("foreseen", twin.PLAIN["foreseen"](*given_), compiled["foreseen"](*given_))


FORESEEN = [9.0, 2.0, 0.1, 0.05, 8.99, 0.025, 0.04, 0.33, 0.01, 3.2]
"""The numbers of `foreseen`, after the answers told and the wire."""


@given(steps=st.lists(st.tuples(st.floats(0.0, 0.06), SOME_RAD, st.integers(0, 3)), min_size=1, max_size=25))
def test_the_way_to_the_wire_is_measured_alike_along_a_drive(compiled, steps):
    told: Told = ()
    wire, now_s = Answers(3.2).wire, 9.0
    for since_s, angle_rad, ago in steps:
        now_s += since_s
        told = (*told[-11:], (now_s, angle_rad))
        given_ = (told, wire, now_s + 0.01, 2.0, told[-1 - ago % len(told)][1], 0.05, now_s, *FORESEEN[5:])
        answer = twin.PLAIN["foreseen"](*given_)
        assert_same("foreseen", answer, compiled["foreseen"](*given_))
        wire = answer[0]


@pytest.mark.parametrize("place", range(15))
@pytest.mark.parametrize("told", [(), ((8.9, 0.1), (8.97, 0.2)), ((math.nan, 0.1), (8.97, math.nan)), ((8.9, 0.3),)])
def test_what_is_no_number_is_foreseen_alike(compiled, place, told):
    numbers = [8.8, 0.01, 0.06, *FORESEEN]
    if place < len(numbers):
        numbers[place] = math.nan
    if place in {1, 2, 9}:  # how long it takes, which is rounded to steps
        for of in (twin.PLAIN, compiled):
            with pytest.raises(ValueError, match="NaN to integer"):
                of["foreseen"]((), tuple(numbers[:3]), *numbers[3:])
        return
    given_ = (told, tuple(numbers[:3]), *numbers[3:])
    assert_same("foreseen", twin.PLAIN["foreseen"](*given_), compiled["foreseen"](*given_))


def test_more_answers_than_are_remembered_are_refused(compiled):
    with pytest.raises(TypeError, match="at most 12 answers"):
        compiled["foreseen"](((9.0, 0.1),) * 13, (8.9, 0.0, 0.1), *FORESEEN)


@given(
    place=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-3.2, 3.2)),
    step_m=st.floats(-2.0, 20.0),
    steering_rad=SOME_RAD,
)
def test_any_step_is_driven_alike(compiled, place, step_m, steering_rad):
    given_ = (*place, step_m, steering_rad, 0.33)
    assert_same("driven_on", twin.PLAIN["driven_on"](*given_), compiled["driven_on"](*given_))


@pytest.mark.parametrize("place", range(6))
def test_what_is_no_number_is_driven_alike(compiled, place):
    given_ = [1.0, 2.0, 0.5, 0.1, 0.2, 0.33]
    for value in (math.nan, math.inf):
        given_[place] = value
        try:
            expected = twin.PLAIN["driven_on"](*given_)
        except ValueError:  # no angle is without end
            with pytest.raises(ValueError, match="math domain error"):
                compiled["driven_on"](*given_)
        else:
            assert_same("driven_on", expected, compiled["driven_on"](*given_))


YES_OR_NO = st.lists(st.booleans(), min_size=12, max_size=12)


@given(
    bearing_rad=st.lists(ANGLE, min_size=12, max_size=12), meets=YES_OR_NO, crosses=YES_OR_NO, count=st.integers(0, 12)
)
def test_any_path_is_bent_and_driven_alike(compiled, bearing_rad, meets, crosses, count):
    radii_m = (*RADII, 0.7, 1.3)
    for yes in ((meets, crosses), ([True] * 12, [True] * 12)):
        path = tuple(tuple(part[:count]) for part in (radii_m, bearing_rad, *yes))
        for speed_mps, mu in ((0.5, 0.3), (4.0, 0.9)):
            given_ = (*path, speed_mps, mu)
            assert_same("fastest_mps", twin.PLAIN["fastest_mps"](*given_), compiled["fastest_mps"](*given_))
    four = RADII[1:5], tuple(bearing_rad[1:5])
    assert_same("bend_of", twin.PLAIN["bend_of"](*four), compiled["bend_of"](*four))


LENGTH = st.floats(0.3, 3.0)


@given(
    near=st.tuples(LENGTH, ANGLE),
    far=st.tuples(LENGTH, ANGLE),
    error_m=st.floats(-2.0, 5.0),
    line=st.one_of(st.just((math.nan, math.nan)), st.tuples(st.floats(-0.5, 0.5), st.floats(-2.0, 2.0))),
    bends=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    speed_mps=st.floats(-1.0, 8.0),
    gains=st.tuples(st.floats(0.0, 9.0), st.floats(0.0, 9.0)),
)
def test_any_ball_is_pursued_alike(compiled, near, far, error_m, line, bends, speed_mps, gains):
    given_ = (*near, *far, error_m, *line, *bends, speed_mps, *gains, 0.33)
    assert_same("pursued", twin.PLAIN["pursued"](*given_), compiled["pursued"](*given_))


@pytest.mark.parametrize("place", range(13))
@pytest.mark.parametrize("line", [(0.1, 0.2), (math.nan, math.nan)])
def test_what_is_no_number_is_pursued_alike(compiled, place, line):
    given_ = [0.7, 0.1, 1.1, 0.2, 0.3, *line, 0.02, 0.04, 1.5, 4.0, 2.0, 0.33]
    given_[place] = math.nan
    assert_same("pursued", twin.PLAIN["pursued"](*given_), compiled["pursued"](*given_))


def test_what_is_no_number_is_tracked_alike(compiled):
    state = twin.PLAIN["predicted"](WallTrack(0.33)._state, 0.02, 0.1, 1.0, 0.33, 0.0)
    for place in range(5):
        step = [0.02, 0.1, 1.0, 0.33, 0.05]
        step[place] = math.nan
        assert_same("predicted", twin.PLAIN["predicted"](state, *step), compiled["predicted"](state, *step))
    for seen in ((math.nan, 0.1), (1.0, math.nan)):
        assert_same("corrected", twin.PLAIN["corrected"](state, *seen), compiled["corrected"](state, *seen))


STEP = st.tuples(st.floats(-0.05, 0.25), st.floats(-0.4, 0.4), st.floats(0.0, 6.0), st.sampled_from([0.0, 0.05]))


@given(steps=st.lists(st.tuples(STEP, st.floats(0.3, 2.0), st.floats(-0.5, 0.5)), min_size=1, max_size=20))
def test_any_line_is_tracked_alike(compiled, steps):
    state = WallTrack(0.33)._state
    for (way_m, wheel_rad, speed_mps, unrest_rad), distance_m, heading_rad in steps:
        step = (state, way_m, wheel_rad, speed_mps, 0.33, unrest_rad)
        state = twin.PLAIN["predicted"](*step)
        assert_same("predicted", state, compiled["predicted"](*step))
        seen = (state, distance_m, heading_rad)
        state = twin.PLAIN["corrected"](*seen)
        assert_same("corrected", state, compiled["corrected"](*seen))


def test_compiled_functions_are_called_without_a_step_in_between(compiled, as_it_was):
    before = my_wall.around
    twin.use(compiled)
    assert my_wall.around is compiled["around"]
    twin.use({"look": compiled["look"]})
    assert my_wall.around is before
    assert perception.look is compiled["look"]


def test_wrong_arguments_are_refused_and_crash_nothing(compiled):
    wrong = (
        (),
        (None,),
        (1, 2, 3),
        ("text",) * 9,
        (np.zeros(3),) * 12,
        (np.zeros((2, 2)),) * 11,
        (np.zeros(0, int),) * 7,
    )
    for function in compiled.values():
        for given_ in wrong:
            with pytest.raises((TypeError, ValueError, OverflowError, IndexError)):
                function(*given_)


def test_arrays_of_different_lengths_are_refused(compiled):
    short, long_m, flags = np.zeros(3), np.zeros(9), np.zeros(9, np.bool_)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["solid_places"](short, long_m, flags)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["dark_around"](flags, flags, short, 0.0, 0.1, 0.0, 1.0)
    with pytest.raises(IndexError, match="no beam 9"):
        compiled["outline"](long_m, long_m, np.array([0, 9]))
    with pytest.raises(IndexError, match="no beam -1"):
        compiled["wall_around"](long_m, long_m, np.array([0, -1]), 0.0, 0.0, 0.0)


def test_the_twins_were_written_for_the_python_that_is_here():
    stale = [
        module.__name__ for module in kernel.MODULES if kernel.fingerprint(module) != kernel._sealed()[module.__name__]
    ]
    assert not stale, "after the twins do the same and these tests pass: python -m runtime.kernel"


@pytest.fixture
def as_it_was():
    yield
    twin.use({})


def test_every_function_that_may_have_a_twin_has_one(compiled):
    assert set(compiled) == set(twin.PLAIN)


def test_who_changes_a_law_drives_his_own(compiled, monkeypatch, as_it_was):
    fingerprint = kernel.fingerprint
    monkeypatch.setattr(kernel, "fingerprint", lambda module: "" if module is movers else fingerprint(module))
    found = kernel.use()
    assert found.functions == set(compiled) - {"small_things"}
    assert "runtime.control.movers changed" in found.words


def test_constants_come_from_the_python():
    known = dict(kernel.constants())
    assert known["PERCEPTION_DIRT_NEARER_THAN_M"] == perception.DIRT_NEARER_THAN_M
    assert known["WALL_GATES_M_2"] == 0.06
    assert known["PREDICTION_STEP_S"] == 0.015


def test_without_a_compiler_python_answers_and_says_so(monkeypatch, tmp_path, as_it_was):
    monkeypatch.setenv("CC", str(tmp_path / "no-such-compiler"))
    found = kernel.use()
    assert not found.functions
    assert "apt install" in found.words


def test_the_numpy_that_runs_is_the_one_it_is_built_for(monkeypatch, as_it_was):
    """Debian's Python has an older numpy's headers among its own: what is built with those cannot be loaded."""
    asked = []
    monkeypatch.setattr(kernel, "built", lambda *sources, folders, extra: asked.append(folders))
    assert not kernel.use().functions
    assert asked[0][0] == np.get_include()


def test_what_cannot_be_loaded_is_named(monkeypatch, tmp_path, as_it_was):
    wrong = tmp_path / "kernel.so"
    wrong.write_bytes(b"not a library")
    monkeypatch.setattr(kernel, "built", lambda *sources, folders, extra: wrong)
    found = kernel.use()
    assert not found.functions
    assert str(wrong) in found.words


def test_it_can_be_switched_off(monkeypatch, as_it_was):
    monkeypatch.setenv(kernel.SWITCH, "0")
    assert not kernel.use().functions
    assert not twin.in_use()


def test_a_twin_needs_a_name_of_its_own():
    def look():
        return None

    with pytest.raises(ValueError, match="look"):
        twin.twin(look)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
def test_it_is_built_once(monkeypatch, tmp_path, compiled, as_it_was):
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path))
    assert kernel.use().functions
    built = list((tmp_path / "wallride").iterdir())
    assert len(built) == 1
    at = built[0].stat().st_mtime_ns
    assert kernel.use().functions
    assert built[0].stat().st_mtime_ns == at
