"""Beams of other lidars: from 0 to 2 pi, clockwise, double, beyond the turn; what a beam sees stays where it is."""

import math

import numpy as np
import pytest

from wallride.sim.live.scenes import RecordingScene
from wallride.sim.recordings import RecordingError
from wallride.sim.recordings.recording import LidarTrack
from wallride.sim.recordings.tracks import Tracks, assemble

STEP_RAD = math.radians(1.0)


def lidar(first_deg, beams, step_deg=1.0, received_s=(0.0, 0.1)):
    """Return scans in which each beam reads its own direction [deg] in hundredths, from 0 to 3.6 m."""
    angles_deg = first_deg + step_deg * np.arange(beams)
    ranges_m = np.tile((np.round(angles_deg) % 360 / 100).astype(np.float32), (len(received_s), 1))
    times_s = np.array(received_s)
    step_rad = math.radians(step_deg)
    return LidarTrack("/scan", times_s, times_s, ranges_m, math.radians(first_deg), step_rad, 0.0, 30.0, 0.1)


def recording(track):
    return assemble("r", Tracks(lidars={"scan": track}), None)


@pytest.mark.parametrize(("first_deg", "beams", "step_deg", "kept", "said"), [
    (-180, 360, 1.0, 360, ""), (-135, 271, 1.0, 271, ""),
    (0, 360, 1.0, 360, "rolled"), (0, 361, 1.0, 360, "the same"), (-180, 361, 1.0, 360, "the same"),
    (180, -1 + 361, 1.0, 360, ""), (0, 400, 1.0, 360, "40 beams are double"), (225, 271, 1.0, 271, ""),
    (135, 271, -1.0, 271, "clockwise"), (360, 361, -1.0, 360, "clockwise"), (90, 360, 1.0, 360, "rolled"),
    (120, 350, 1.0, 360, "rolled"),
])  # fmt: skip
def test_each_beam_once_from_right_to_left_with_ahead_in_the_middle(first_deg, beams, step_deg, kept, said):
    found = recording(lidar(first_deg, beams, step_deg))
    angles_rad = found.angle_min_rad + found.angle_step_rad * np.arange(found.beams)
    assert found.beams == kept
    assert -math.pi - STEP_RAD < angles_rad[0] < -math.pi / 2
    assert math.pi / 2 < angles_rad[-1] < math.pi + STEP_RAD / 2 + 1e-6
    seen = np.isfinite(found.ranges_m[0])
    assert seen.sum() == min(beams, kept)
    np.testing.assert_allclose(found.ranges_m[0][seen], np.round(np.degrees(angles_rad[seen])) % 360 / 100, atol=1e-6)
    assert said in " ".join(found.notes)
    assert bool(found.notes) == bool(said)
    assert RecordingScene(found).model.beam_count == kept


@pytest.mark.parametrize(("track", "said"), [
    (lidar(-43, 87), r"r: a car would not drive by its lidar, which sees from -43 to 43 degrees"),
    (lidar(0, 200), r"sees from 0 to 199"), (lidar(0, 350), r"sees from 0 to 349"),
    (lidar(-135, 91, 3.0), r"a beam every 3 degrees"),
    (lidar(-135, 271, received_s=(0.0, 1.0)), r"turns at 1 Hz"),
    (lidar(-135, 27001, 0.01), r"field from step|not a number"),
])  # fmt: skip
def test_a_lidar_that_the_car_would_refuse_is_refused_in_one_sentence_before_anything_drives(track, said):
    with pytest.raises(RecordingError, match=said):
        RecordingScene(recording(track))
