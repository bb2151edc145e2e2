"""`wallride.gym`: what gymnasium asks for, and the same car as everywhere else."""

import math
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from wallride.gym import NAME, WallFollowEnv


@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")  # its advice; ours is metres per second and radians
def test_it_is_registered_and_passes_gymnasiums_own_checker():
    environment = gymnasium.make(f"wallride.gym:{NAME}", world="corridor", render_mode="rgb_array")
    check_env(environment.unwrapped, skip_render_check=False)
    environment.close()


def drive(environment, policy, steps, seed=3):
    observation, info = environment.reset(seed=seed)
    rewards = []
    for _ in range(steps):
        observation, reward, contact, over, info = environment.step(policy(observation, info))
        rewards.append(reward)
        if contact or over:
            break
    return observation, rewards, info, (contact, over)


def straight(speed_mps):
    return lambda _observation, _info: np.array([speed_mps, 0.0], np.float32)


def test_the_same_seed_gives_the_same_episode_and_another_one_another():
    environment = WallFollowEnv("corridor")
    first = drive(environment, straight(1.0), 40)
    again, other = drive(environment, straight(1.0), 40), drive(environment, straight(1.0), 40, seed=4)
    assert first[1] == again[1]
    assert np.array_equal(first[0]["scan"], again[0]["scan"])
    assert not np.array_equal(first[0]["scan"], other[0]["scan"])


def test_it_drives_what_it_is_told_after_the_cars_own_delays():
    observation, rewards, info, _ = drive(WallFollowEnv("corridor", varies=False), straight(2.0), 80)
    assert info["time_s"] == pytest.approx(2.0)
    assert observation["odometry"][3] == pytest.approx(2.0, abs=0.1)
    assert observation["odometry"][0] == pytest.approx(info["pose"][0], abs=0.1)
    assert info["pose"][0] == pytest.approx(sum(rewards), rel=0.1)  # beside the wall a metre is a point
    assert 3.0 < info["pose"][0] < 4.0
    assert observation["scan"].shape == (1081,)
    assert observation["scan"][180 + 720] == pytest.approx(1.0, abs=0.06)  # 90 degrees to the left


def test_a_contact_ends_an_episode_and_time_truncates_one():
    *_, rewards, info, ends = drive(WallFollowEnv("dead_end"), straight(3.0), 400)
    assert ends == (True, False)
    assert rewards[-1] < -9
    assert info["contact_mps"] > 2.0
    *_, ends = drive(WallFollowEnv("corridor", duration_s=0.5), straight(0.5), 400)
    assert ends == (False, True)


def test_a_simple_controller_follows_the_wall_round_a_track():
    def follow(observation, _info):
        beside = observation["scan"][780:1021]  # 60 to 120 degrees to the left
        nearest = int(np.argmin(beside))
        toward_rad = np.radians(nearest / 4 - 30)  # below zero: the nearest return is ahead of the shoulder
        steering_rad = 0.8 * (float(beside[nearest]) - 1.0) + 1.5 * toward_rad
        return np.array([1.0, np.clip(steering_rad, -0.34, 0.34)], np.float32)

    environment = WallFollowEnv("track:seed=7,length=40", duration_s=45.0)
    *_, rewards, info, ends = drive(environment, follow, 1800)
    assert ends == (False, True)
    assert info["laps"] > 1.0
    assert sum(rewards) > 36.0


def test_conditions_and_starts_are_as_asked():
    environment = WallFollowEnv(
        "corridor", lidar={"beams": 541, "own_parts": "posts"}, vehicle={"grip_mu": 0.5}, obstacles=["box at=5,0"]
    )
    observation, info = environment.reset(seed=1, options={"start": (1.0, 0.2, 0.1)})
    assert info["pose"] == (1.0, 0.2, 0.1)
    assert observation["scan"].shape == (541,)
    with pytest.raises(ValueError, match="would start in a wall of corridor"):
        environment.reset(options={"start": (1.0, 0.95, 0.0)})
    with pytest.raises(ValueError, match="no world is called"):
        WallFollowEnv("nowhere")


@pytest.mark.parametrize(
    "action", [[math.nan, 0.0], [1.0, math.nan], [math.inf, 0.0], [0.0, -math.inf], [1.0], [1.0, 0.0, 0.0], 1.0]
)
def test_an_action_that_is_not_two_finite_numbers_moves_nothing(action):
    environment = WallFollowEnv("corridor")
    _, before = environment.reset(seed=1)
    with pytest.raises(ValueError, match="must be two finite numbers"):
        environment.step(np.array(action, np.float32))
    after = environment.step(np.zeros(2, np.float32))[-1]
    assert after["time_s"] == pytest.approx(0.025)
    assert after["pose"] == before["pose"]


@pytest.mark.parametrize("action", ["x", ["1", "0"], [1 + 2j, 0.0], None, [True, False], [None, 0.0]])
def test_an_action_of_something_else_is_named(action):
    environment = WallFollowEnv("corridor")
    environment.reset(seed=1)
    with pytest.raises(ValueError, match=r"action .*: it must be two finite numbers"):
        environment.step(action)


def test_a_step_needs_a_reset_before_it():
    with pytest.raises(gymnasium.error.ResetNeeded, match="step before reset: call reset first"):
        WallFollowEnv("corridor").step(np.zeros(2, np.float32))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"strat": (1.0, 0.2, 0.1)}, "options 'strat': only \"start\" is known"),
        ({"start": ("1", "0", "0")}, "it must be three numbers"),
        ({"start": (1j, 0, 0)}, "it must be three numbers"),
        ({"start": (0.0, 0.0)}, "three numbers"),
        ({"start": (math.nan, 0.0, 0.0)}, "outside corridor"),
        ({"start": (0.0, 0.0, math.nan)}, "outside corridor"),
        ({"start": (1000.0, 1000.0, 0.0)}, "outside corridor"),
    ],
)
def test_options_of_a_reset_that_name_no_start_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        WallFollowEnv("corridor").reset(options=options)


def test_a_closed_environment_refuses_steps_and_resets():
    environment = WallFollowEnv("corridor")
    environment.reset(seed=1)
    environment.close()
    environment.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="step after close"):
        environment.step(np.zeros(2, np.float32))
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="reset after close"):
        environment.reset(seed=1)


def test_a_picture_shows_walls_car_and_scan_and_moves_with_the_car():
    environment = WallFollowEnv("corridor", render_mode="rgb_array", varies=False, obstacles=["box at=3,0"])
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.render()
    environment.reset(seed=1)
    first = environment.render()
    assert first is not None
    assert first.dtype == np.uint8
    assert first.shape == (480, 480, 3)
    middle, beside = first[225:255, 235:265], first[205:215, 235:265]  # one metre is 30 pixels
    assert (middle == (0xFF, 0x7F, 0x0E)).all(axis=2).any(), "the car"
    assert (beside == (0xD6, 0x27, 0x28)).all(axis=2).any(), "what it sees of the wall"
    for _ in range(40):
        environment.step(np.array([1.5, 0.0], np.float32))
    assert (environment.render() != first).any(axis=2).sum() > 50
    assert WallFollowEnv("corridor").render() is None
    with pytest.raises(ValueError, match='None or "rgb_array"'):
        WallFollowEnv("corridor", render_mode="human")


def test_a_copy_goes_on_as_the_environment_does():
    environment = WallFollowEnv("track:seed=7,length=40", obstacles=["person at=6,0 walks=0,0.5"])
    drive(environment, straight(1.0), 20)
    copy = pickle.loads(pickle.dumps(environment))  # noqa: S301 - our own
    for _ in range(20):
        ours, theirs = (one.step(np.array([1.0, 0.1], np.float32)) for one in (environment, copy))
        assert np.array_equal(ours[0]["scan"], theirs[0]["scan"])
        assert ours[1:] == theirs[1:]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"side": "up"}, 'side \'up\': it is "left" or "right"'),
        ({"desired_distance_m": math.nan}, "desired_distance_m nan: it must be a positive number"),
        ({"desired_distance_m": -3.0}, "must be a positive number"),
        ({"duration_s": -1.0}, "duration_s -1.0: it must be a positive number"),
        ({"vehicle": {"grip": 1}}, "vehicle.grip = 1: there is no such condition; did you mean vehicle.grip_mu?"),
    ],
)
def test_what_no_environment_can_be_made_of_is_one_sentence(wrong, words):
    with pytest.raises(ValueError, match=words) as told:
        WallFollowEnv("corridor", **wrong)
    assert "\n" not in str(told.value)
