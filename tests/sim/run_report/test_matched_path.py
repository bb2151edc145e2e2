"""The report's path by matched scans, whatever the odometry says."""

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.replay.recorded import record
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros import messages
from wallride.runtime.ros.definitions import TYPES
from wallride.sim.replay.drive_log import DriveLog, LoggedMessage, read_log
from wallride.sim.replay.run import run_of
from wallride.sim.run_report.matched_path import matched_path, told_path
from wallride.sim.run_report.page import page
from wallride.sim.run_report.shown import shown
from wallride.sim.run_report.track import spans


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A drive around a corner, and where it ended, seen from its start."""
    path = tmp_path_factory.mktemp("matched") / "drive.mcap"
    _, twin = record(path, seconds=8.0)
    end, start = twin.vehicle.pose, twin.world.start
    return read_log(path), (end.x_m - start.x_m, end.y_m - start.y_m)


def drifting(run):
    return replace(run.path, x_m=1.1 * run.path.x_m, yaw_rad=run.path.yaw_rad + 0.03 * run.path.time_s)


def test_places_are_the_scans_and_not_the_odometrys(driven):
    log, (x_m, y_m) = driven
    run = run_of(log)
    found = matched_path(log, replace(run, path=drifting(run)))
    assert np.hypot(found.x_m[-1] - x_m, found.y_m[-1] - y_m) < 0.3
    assert np.hypot(run.path.x_m[-1] - x_m, run.path.y_m[-1] - y_m) > 0.35, "the odometry's own"
    assert np.array_equal(found.speed_mps, run.path.speed_mps)
    assert "By matched scans, with the walls" in page(shown(replace(run, path=found)))
    assert spans(shown(replace(run, path=found, duration_s=200.0))) == spans(shown(run)), "it needs no parts"


def test_what_the_scans_do_not_tell_stays_as_it_is(driven, run):
    log, _ = driven
    long = run_of(log)
    long.path = replace(long.path, speed_mps=np.full_like(long.path.speed_mps, 50.0))
    assert matched_path(log, long) is long.path
    standing = run_of(log)
    standing.path = replace(standing.path, speed_mps=np.zeros_like(standing.path.speed_mps))
    assert matched_path(log, standing) is standing.path
    assert "By odometry, with the walls" in page(shown(run))


def posed(log, run, times_s):
    """Return the log with poses on a map, 10 m north of what the odometry says."""
    told = []
    for at_s in times_s:
        stamp_ns = round((run.zero_unix_s + at_s) * NS)
        x_m, y_m = (float(np.interp(at_s, run.path.time_s, part)) for part in (run.path.x_m, run.path.y_m))
        payload = messages.pose(stamp_ns, x_m, 10.0 + y_m, 0.5, 0.02, 0.01)
        told.append(LoggedMessage("pose", TYPES["pose"], stamp_ns, payload))
    return DriveLog(log.name, [*log.messages, *told], log.metadata)


def test_poses_on_the_map_count_more_where_they_are_known_all_the_way(driven):
    log, _ = driven
    run = run_of(log)
    every_s = np.arange(0.0, run.duration_s, 0.1)
    found = told_path(posed(log, run, every_s), run)
    assert (found.by, found.drifts) == ("poses on the map", False)
    assert np.abs(found.y_m - run.path.y_m - 10.0).max() < 0.2
    assert np.allclose(found.yaw_rad, 0.5)
    gap = posed(log, run, every_s[(every_s < 3.0) | (every_s > 4.0)])
    assert told_path(gap, run).by == "matched scans", "1.5 m without a pose"
    assert told_path(log, run).by == "matched scans"
