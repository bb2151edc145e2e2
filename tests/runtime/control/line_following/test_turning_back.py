"""A car that a hard stop has turned goes on with its race: whole drives in virtual time."""

import math

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import round_the_block
from wallride.runtime.control.laws import LawStack
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.line_follower import DRIVES, WRONG_WAY
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.recovery.way_out import TURNS
from wallride.runtime.settings.tree import load_settings
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose


@pytest.mark.slow
def test_it_turns_back_and_drives_on_along_the_line(room, field):
    start, line = (6.0, 0.1, 2.0), round_the_block()
    slow = "wall_follow.faster_each_lap=0"  # no car drives these bends at the speed of the line
    settings = load_settings(None, ["wall_follow.method=line", "wall_follow.side=right", "car.max_speed_mps=3", slow])
    course = RaceCourse("ring", field, Localizer(field, settings.car, start), line)
    laws = LawStack(settings.wall_follow, settings.safety, settings.car, course=course)
    world = World("ring", room.geometry, Pose(*start), "right")
    run = drive(Case(world, duration_s=30.0, seed=910002, car=settings.car), laws.follower, laws.judge)
    assert run.contact is None
    assert TURNS in run.reasons
    assert run.reasons[-1] == DRIVES
    assert run.reasons.count(WRONG_WAY) < 40
    along_m = [line.nearest(complex(*place)).along_m for place in run.pose[:, :2]]
    way_m = np.sum([math.remainder(step_m, line.length_m) for step_m in np.diff(along_m)])
    assert way_m > line.length_m, "a lap, in the direction of the line"
