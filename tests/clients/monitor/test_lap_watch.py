"""When a lap has met its beginning: the hint for the driver, on recorded drives and on made ones."""

import math

import numpy as np
import pytest

from tests.sim.replay.recorded import record
from wallride.clients.monitor.lap_watch import ALIKE_M, JUMP_M, LAP_M, SECTORS, LapWatch, differences, profile
from wallride.drivers.api import Scan
from wallride.runtime.ros import messages
from wallride.runtime.ros.laser_scan import read_laser_scan
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import read_log

LOOP_M = 28.0
"""Way of a car round the world `loop`, about."""


def watched(path, **drive):
    """Return what is told of a drive that is recorded, and the way after which its lap was closed, None without."""
    record(path, **drive)
    log, watch, closed_m = read_log(path), LapWatch(), None
    for message in sorted(log.messages, key=lambda one: one.stamp_ns):
        if message.topic in {topics.STATUS, topics.SCAN}:
            watch.take(message.topic, message.payload)
        if watch.is_closed and closed_m is None:
            closed_m = watch.way_m
    return watch, closed_m


def test_a_lap_that_goes_on_past_its_beginning_and_a_corner_is_closed(tmp_path):
    sections = {"wall_follow": {"speed_mps": 4.0}}
    watch, closed_m = watched(tmp_path / "lap.mcap", seconds=15.0, sections=sections)
    assert closed_m is not None
    assert LOOP_M - 2.0 < closed_m < 1.5 * LOOP_M
    assert watch.words.endswith("a corner included: stop when you like.")


def test_half_a_lap_that_looks_like_its_beginning_is_not_closed(tmp_path):
    watch, closed_m = watched(tmp_path / "half.mcap", seconds=6.5, sections={"wall_follow": {"speed_mps": 4.0}})
    assert watch.way_m > 0.5 * LOOP_M
    assert closed_m is None
    assert "has not come in sight again" in watch.words


def test_a_corridor_has_no_lap(tmp_path):
    watch, closed_m = watched(tmp_path / "straight.mcap", world="straight", seconds=8.0)
    assert watch.way_m > LAP_M
    assert closed_m is None


def status(x_m, recording="", y_m=0.0, yaw_rad=0.0):
    return {"odom": {"x_m": x_m, "y_m": y_m, "yaw_rad": yaw_rad}, "recording": {"file": recording}}


def test_a_new_recording_is_a_new_lap_and_the_end_of_one_is_none():
    watch = LapWatch()
    for k in range(10):
        watch.take_status(status(float(k), "one.mcap"))
    assert watch.words.startswith("9 m of way")
    watch.take_status(status(9.0))
    assert watch.words.startswith("9 m of way"), "it has ended, and can be mapped"
    watch.take_status(status(9.0, "two.mcap"))
    assert watch.words == ""


def test_an_odometry_that_begins_anew_is_a_new_lap():
    watch = LapWatch()
    for k in range(10):
        watch.take_status(status(float(k)))
    watch.take_status(status(9.0 - 1.1 * JUMP_M))
    assert watch.words == ""


@pytest.mark.parametrize(
    ("topic", "payload"),
    [
        (topics.STATUS, b"no"), (topics.STATUS, b"[]"), (topics.STATUS, b'{"odom": 3}'), (topics.STATUS, b"{}"),
        (topics.STATUS, topics.encode(status(math.nan))), (topics.SCAN, b""), (topics.SCAN, b"\0" * 400),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_left_out(topic, payload):
    watch = LapWatch()
    watch.take(topic, payload)
    assert (watch.words, watch.is_closed) == ("", False)


def ring(radius_m, beams=720):
    """Return the scan of a round room, open behind."""
    ranges_m = np.full(beams, radius_m, dtype=np.float32)
    ranges_m[: beams // 8] = ranges_m[-beams // 8 :] = np.nan
    scan = Scan(0.0, 0.0, -math.pi, math.tau / beams, 0.02, 30.0, ranges_m, 1)
    return read_laser_scan(messages.laser_scan(1_790_000_000_000_000_000, scan, 0.05))


def test_a_bend_in_which_all_places_look_alike_closes_no_lap():
    watch = LapWatch()
    for turned_rad in np.arange(0.0, 2.5 * math.tau, 0.1):
        x_m, y_m = 3.0 * math.sin(turned_rad), -3.0 * math.cos(turned_rad)
        watch.take_status(status(x_m, y_m=y_m, yaw_rad=turned_rad))
        watch.take_scan(ring(2.0))
    assert watch.way_m > 2.4 * 3.0 * math.tau
    assert not watch.is_closed
    assert watch.words.endswith("drive on, round one more corner.")


def test_a_place_is_its_nearest_range_in_each_direction():
    seen = profile(ring(2.0))
    assert seen.shape == (SECTORS,)
    assert np.nanmax(np.abs(seen - 2.0)) < 1e-6
    assert np.isnan(seen[SECTORS // 2])
    assert np.isfinite(seen[0])


def test_places_differ_by_what_both_see():
    here = profile(ring(2.0))
    blind = np.full(SECTORS, np.nan)
    corner = np.where(np.arange(SECTORS) < SECTORS // 4, 1.0, here)
    off_m = differences(corner, np.array([corner, np.roll(corner, 2), corner + 0.3, blind]))
    assert off_m == pytest.approx([0.0, 0.0, 0.3, math.inf], abs=1e-5), "the second is the first, turned"
    assert off_m[1] < ALIKE_M < off_m[2]
