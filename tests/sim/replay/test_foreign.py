"""Somebody else's drives under our laws: real ones all replay, broken ones are refused or saved as far as they go."""

import json

import numpy as np
import pytest

from wallride.runtime.wire import topics
from wallride.sim.recordings import OdometryTrack, Recording, RecordingError, load_recording
from wallride.sim.replay.drive_log import decode
from wallride.sim.replay.foreign import drive_recording, motor_states, open_any, settings_for
from wallride.sim.virtual.devices import ranges_between_walls

BEAMS = 1081


def recording(times_s, **changes):
    """A car that stands between two walls, seen at the times given."""
    times_s = np.asarray(times_s, dtype=np.float64)
    ranges_m = np.tile(ranges_between_walls(1.0, 1.0), (len(times_s), 1))
    values = {
        "name": "made", "topic": "/scan", "other_topics": (), "received_s": times_s, "stamp_s": times_s - 0.01,
        "ranges_m": ranges_m, "angle_min_rad": -0.75 * np.pi, "angle_step_rad": 1.5 * np.pi / (BEAMS - 1),
        "range_min_m": 0.02, "range_max_m": 30.0, "scan_time_s": 0.025, "commands": {}, "odometry": None, "notes": (),
    }  # fmt: skip
    return Recording(**{**values, **changes})


def driven(made, *assignments):
    settings, notes = settings_for(made, assignments)
    return drive_recording(made, settings, notes)


def test_it_says_what_the_car_would_have_said_on_the_cars_own_topics():
    log = driven(recording(np.arange(0, 2, 0.025)))
    assert {topics.SCAN, topics.ODOM, topics.DISTANCE_ERROR, topics.OUTPUT, topics.DECISION, topics.STATUS} <= set(
        log.by_topic
    )
    assert len(log.of(topics.SCAN)) == len(log.of(topics.DISTANCE_ERROR)) == 80
    errors_m = [decode(message).data for message in log.of(topics.DISTANCE_ERROR)]
    assert np.abs(errors_m).max() < 0.02
    decisions = [fields["reason"] for _, fields in log.json(topics.DECISION)]
    assert decisions[0] == "wall"
    assert json.loads(log.of(topics.STATUS)[-1].payload)["scans"] > 70


def test_a_hole_in_a_recording_is_a_stop():
    log = driven(recording([*np.arange(0, 1, 0.025), *np.arange(4, 5, 0.025)]))
    said = [(time_ns / 1e9, fields["reason"], fields["allowed_mps"]) for time_ns, fields in log.json(topics.DECISION)]
    stopped = [entry for entry in said if entry[2] == 0]
    assert 0.975 < stopped[0][0] < 1.2
    assert stopped[0][1] in {"no word from teleop or navigation", "no word from safety", "the scan is too old"}
    assert said[-1][2] > 0, "it goes on when the scans do"


def test_side_and_speed_are_the_recorded_cars_unless_assigned():
    made = recording(np.arange(0, 1, 0.025))
    settings, notes = settings_for(made, [])
    assert any(settings.wall_follow.side in note for note in notes)
    settings, notes = settings_for(made, ["wall_follow.side=right", "wall_follow.speed_mps=2.5"])
    assert (settings.wall_follow.side, settings.wall_follow.speed_mps, notes) == ("right", 2.5, [])


def test_odometry_is_believed_before_the_scans_are_matched():
    times_s = np.arange(0, 2, 0.02)
    still = np.zeros_like(times_s)
    track = OdometryTrack(times_s, times_s, still, still, still + 1.0, still, still + 0.5)
    made = recording(np.arange(0, 2, 0.025), odometry=track)
    states = motor_states(made, settings_for(made, [])[0])
    assert {state.speed_mps for state in states} == {1.0}
    assert states[-1].distance_m == pytest.approx(1.96, abs=0.03)
    assert states[-1].steering_rad == pytest.approx(np.arctan(0.5 * 0.33), abs=1e-9)


def test_scans_of_several_lidars_on_one_topic_are_refused():
    stamps_s = np.arange(0, 2, 0.025)
    with pytest.raises(RecordingError, match="several lidars on one topic"):
        driven(recording(stamps_s, stamp_s=np.where(np.arange(80) % 4 == 0, stamps_s - 900, stamps_s)))


@pytest.mark.parametrize(
    ("name", "scans"),
    [
        ("originals/t1_standing_all_topics", 404),
        ("originals/t1_standing_odom_nav", 126),
        ("originals/t14_inside_corner_2mps", 300),
        ("originals/urg04lx_front_rear_726.bag", None),
        ("damaged/crlf_stripped_v2.bag", 360),
    ],
)
def test_real_recordings_replay(shared_data, name, scans):
    opened = open_any(shared_data / name)
    assert not opened.ours
    assert len(opened.log.of(topics.SCAN)) == (scans or len(load_recording(shared_data / name)))
    assert len(opened.log.of(topics.DISTANCE_ERROR)) == len(opened.log.of(topics.SCAN))
    if "damaged" in name:
        assert "360 scans were saved" in opened.log.notes[0]


def test_the_carried_bag_replays_where_no_other_recording_is(carried_bag):
    log = open_any(carried_bag).log
    assert len(log.of(topics.SCAN)) == 40
    assert log.fact("source").startswith("urg04lx_people_40")
