"""Which of a recording's drive topics is the autonomous program's: teams name them freely."""

from types import MappingProxyType

import numpy as np
import pytest

from wallride.sim.recordings import CommandTrack, Recording


def track(count=3):
    return CommandTrack(np.arange(count) * 0.1, np.ones(count), np.full(count, 0.1))


def recording(**counts):
    commands = MappingProxyType({topic: track(count) for topic, count in counts.items()})
    return Recording(
        "scan", np.array([0.0]), np.array([0.0]), np.ones((1, 3), np.float32), -1.0, 1.0, 0.02, 30.0, 0.025, "some.bag",
        (), commands, None,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("counts", "chosen"),
    [
        ({"drive": 3, "vesc_input_navigation": 9}, "drive"),
        ({"vesc_input_navigation": 3, "vesc_input_teleop": 9}, "vesc_input_navigation"),
        ({"vesc_high_level_ackermann_cmd": 3, "vesc_input_safety": 9}, "vesc_high_level_ackermann_cmd"),
        ({"pure_pursuit": 3, "wall_follower": 9}, "wall_follower"),
        ({"pure_pursuit": 9, "auto_cmd": 3}, "auto_cmd"),
        ({"ego_drive": 3, "joy_drive": 9}, "ego_drive"),
    ],
)
def test_the_most_likely_topic_is_taken(counts, chosen):
    kept = recording(**counts)
    assert kept.navigation is kept.commands[chosen]


@pytest.mark.parametrize(
    "counts", [{}, {"vesc_input_teleop": 3}, {"vesc_low_level_ackermann_cmd": 3}, {"empty_nav": 0}]
)
def test_where_no_program_spoke_there_is_none(counts):
    assert recording(**counts).navigation is None
