"""A recorded drive through the car's eyes and safety, on recordings whose truth is known."""

import math

import numpy as np
import pytest

from benchmarks.lab.recorded.episodes import episodes, room_along_m
from benchmarks.lab.recorded.reenact import gap_m, reenact, run_at_wall
from benchmarks.lab.recorded.replay import jumps, noise, replay
from tests.sim.recordings.recorded_drives import arc_poses, recorded, track
from wallride.sim.world.pose import Pose

MUX = "vesc_low_level_ackermann_cmd"


def test_noise_is_that_of_one_value_whatever_the_motion():
    random = np.random.default_rng(0)
    moving = 1.0 + 0.02 * np.arange(4000) + random.normal(0, 0.005, 4000)
    assert noise(moving) == pytest.approx(0.005, rel=0.05)
    moving[1000:] += 0.7  # another wall
    assert noise(moving) == pytest.approx(0.005, rel=0.05)
    assert jumps(moving) == 1
    assert math.isnan(noise(np.array([1.0, np.nan, 1.0])))


def test_the_mux_is_asked_before_the_program_and_the_motion_last():
    poses = arc_poses(30, 1.0)
    both = {MUX: track(1.5, 0.1), "vesc_low_level_input_navigation": track(2.5)}
    assert replay(recorded(poses, commands=both), "left").judged[-1].asked.origin == "mux"
    assert replay(recorded(poses, commands=both), "left").judged[-1].asked.speed_mps == 1.5
    program = {"vesc_low_level_input_navigation": track(2.5)}
    assert replay(recorded(poses, commands=program), "left").judged[-1].asked.origin == "program"
    shown = replay(recorded(poses), "left").judged[15].asked
    assert shown.origin == "motion"
    assert shown.steering_rad == pytest.approx(0.0, abs=0.02)
    assert shown.speed_mps == pytest.approx(1.0, abs=0.05)


def test_without_any_command_the_ways_own_curvature_is_asked_for_and_not_straight_on():
    asked = replay(recorded(arc_poses(30, 1.0, 0.4)), "left").judged[15].asked
    assert asked.origin == "motion"
    assert asked.steering_rad == pytest.approx(math.atan(0.4 * 0.33), abs=0.02)


def test_a_program_may_ask_for_more_than_the_wheels_can_do():
    commands = {"vesc_low_level_input_navigation": track(1.0, 0.9)}
    assert replay(recorded(arc_poses(20, 1.0), commands=commands), "left").judged[-1].asked.steering_rad == 0.34


def test_a_command_of_long_ago_counts_no_more():
    done = replay(recorded(arc_poses(60, 1.0), commands={MUX: track(1.0, until_s=0.5)}), "left")
    assert done.judged[15].drives
    assert not done.judged[-1].drives


def test_driving_on_toward_a_wall_is_stopped_and_came_close():
    # The wall is at x = 8: the bumper ends 2 cm before it.
    poses = [*arc_poses(64, 1.5, start=Pose(5.2, 0.0, 0.0))]
    done = replay(recorded(poses, commands={MUX: track(1.5)}), "left")
    (found,) = episodes(done)
    assert found.stop
    assert found.outcome == "came close"
    assert found.room_m < 0.05
    assert 0.0 < found.way_m < 1.0


def test_a_wall_that_the_car_really_kept_away_from_was_needless_to_brake_for():
    """Told to steer into the wall, it went straight on (somebody led it by the hand)."""
    poses = arc_poses(60, 1.5, start=Pose(0.0, 0.7, 0.0))
    done = replay(recorded(poses, commands={MUX: track(1.5, 0.34)}), "left")
    found = episodes(done)
    assert {episode.outcome for episode in found} == {"passed"}
    assert min(episode.room_m for episode in found) == pytest.approx(0.15, abs=0.05)


def test_a_clear_drive_is_left_alone():
    done = replay(recorded(arc_poses(60, 1.5), commands={MUX: track(1.5)}), "left")
    assert episodes(done) == []
    assert room_along_m(done.motion, done.judged, 10) == pytest.approx(0.85, abs=0.06)
    assert not done.masked.any()


def test_whoever_stood_within_a_second_was_stopped():
    ahead = arc_poses(40, 1.5, start=Pose(5.9, 0.0, 0.0))
    poses = ahead + [ahead[-1]] * 30
    done = replay(recorded(poses, commands={MUX: track(1.5)}), "left")
    assert {episode.outcome for episode in episodes(done)} == {"was stopped"}


def test_a_run_at_a_wall_is_driven_again_on_its_own_scan():
    ahead = arc_poses(50, 1.5, start=Pose(5.0, 0.0, 0.0))
    poses = [Pose(5.0, 0.0, 0.0)] * 20 + ahead + [ahead[-1]] * 20
    done = replay(recorded(poses, commands={MUX: track(1.5, until_s=1.6)}), "left")
    real = run_at_wall(done)
    assert real is not None
    assert real.rest_m == pytest.approx(8.0 - ahead[-1].x_m - 0.42, abs=0.03)
    assert gap_m(done.judged[0]) == pytest.approx(8.0 - 5.0 - 0.42, abs=0.03)
    braked = 64  # the first scan without a command
    assert real.braked_scan == pytest.approx(braked, abs=14)
    for run in reenact(done, real):
        assert run.touched_mps == 0.0
        assert 0.05 < run.rest_m < 0.5
        assert run.slower_gap_m > run.needs_m
        assert run.impact_mps == 0.0


def test_a_drive_along_a_wall_is_no_run_at_one():
    assert run_at_wall(replay(recorded(arc_poses(60, 1.0), commands={MUX: track(1.0)}), "left")) is None
