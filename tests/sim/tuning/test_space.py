"""What may be tuned: known settings within their bounds, and nothing that would loosen safety."""

import re

import pytest

from wallride.runtime.parameters.policy import LOOSENS, Loosens
from wallride.sim.lab.laws import settings_of
from wallride.sim.tuning.space import SpaceError, space_of

SETTINGS = settings_of("ball+swept", "left", 1.0, 1.0)


def test_the_gains_of_a_law_are_tuned_without_a_word():
    kp, kd = space_of(SETTINGS, [])
    assert (kp.name, kp.lowest, kp.highest) == ("wall_follow.kp", 6.75, 20.0)  # 20 is its bound
    assert (kd.name, kd.lowest, kd.highest) == ("wall_follow.kd", 2.25, 9.0)


def test_switches_choices_and_whole_numbers_are_parameters():
    switch, choice, whole = space_of(
        SETTINGS, ["wall_follow.trim_integral", "wall_follow.no_wall", "safety.recovery.tries=3:6"]
    )
    assert switch.choices == (False, True)
    assert choice.choices == ("slow", "search", "stop")
    assert whole.whole


@pytest.mark.parametrize(
    "text",
    [
        "safety.grip_mu=0.6:0.9",
        "safety.hard_share",
        "safety.front_margin_m=0.02:0.1",
        "safety.stale_s=0.2:0.3",
        "safety.gentle_share=0.2:0.3",
        "safety.odometry_check",
        "car.max_speed_mps",
    ],
)
def test_what_would_loosen_safety_is_refused(text):
    with pytest.raises(SpaceError, match="would loosen safety"):
        space_of(SETTINGS, [text])


def test_no_number_of_safety_can_be_tuned_without_a_range():
    """Half to twice the present value reaches the loose side of every limit."""
    for name in LOOSENS:
        if name.startswith("safety.") and LOOSENS[name] in {Loosens.UP, Loosens.DOWN, Loosens.ANY}:
            with pytest.raises(SpaceError):
                space_of(SETTINGS, [name])


@pytest.mark.parametrize(
    "text", ["safety.grip_mu=0.6:0.8", "safety.front_margin_m=0.03:0.1", "safety.stale_s=0.1:0.25"]
)
def test_the_strict_side_of_a_limit_may_be_tuned(text):
    assert len(space_of(SETTINGS, [text])) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wall_follow.kpp", "is not a setting"),
        ("wall_follow.kp=3", "NAME=LOWEST:HIGHEST"),
        ("wall_follow.kp=5:3", "must grow"),
        ("wall_follow.kp=1:30", "from 0 to 20"),
        ("wall_follow.speed_mps", "every scenario has its own"),
        ("wall_follow.no_wall=a:b", "leave the range out"),
        ("car.name", "only numbers"),
        ("lidar.address", "only numbers"),
    ],
)
def test_a_wrong_parameter_says_what_to_write(text, words):
    with pytest.raises(SpaceError, match=re.escape(words)):
        space_of(SETTINGS, [text])
