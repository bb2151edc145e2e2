"""The lab's starts and its corner, driven by the unmodified process through its real drivers, in real time.

A drive of each kind shows that the process does what the laws do in virtual time, where tests/sim has them all.
"""

import json
import math
from pathlib import Path

from wallride.cli import main
from wallride.sim.world.pose import Side
from wallride.sim.world.worlds import load_world

ROOT = Path(__file__).resolve().parents[2]
DRIVE_S = 11.0


REPORT = ("wall_follow.method=report", "safety.method=report", "wall_follow.speed_mps=1")


def drive(tmp_path, world, side, pose, seconds=DRIVE_S, settings=REPORT):
    result = tmp_path / "summary.json"
    pose_text = f"{pose.x_m},{pose.y_m},{pose.yaw_rad}"
    arguments = ["sim", world, "--headless", "--duration", f"{seconds}", f"--pose={pose_text}", "--json", str(result)]
    settings = [f"wall_follow.side={side}", *settings]
    assert main([*arguments, *(word for setting in settings for word in ("--set", setting))]) == 0
    return json.loads(result.read_text())


def test_a_start_settles_without_contact(tmp_path):
    world = load_world("straight", side="left")
    start = world.start_at(distance_m=0.7, toward_wall_rad=math.radians(30))
    summary = drive(tmp_path, "straight", "left", start)
    assert not summary["collided"]
    assert not summary["stopped"]
    assert summary["settle_s"] is not None
    assert summary["settle_s"] < 8
    assert summary["winners"]["navigation"] > DRIVE_S - 2


def test_an_inside_corner_is_turned(tmp_path):
    side: Side = "right"
    world = load_world("inside_corner", side=side)
    summary = drive(tmp_path, "inside_corner", side, world.start, seconds=16.0)
    assert not summary["collided"]
    assert not summary["stopped"]
    assert summary["min_clearance_m"] > 0.3
    assert summary["settle_s"] is not None


def test_the_default_laws_drive_faster_and_closer(tmp_path):
    speed_mps, error_m = 3, 0.06
    start = load_world("loop", side="left").start
    before_the_wall_ends_s = 7.0
    settings = [f"wall_follow.speed_mps={speed_mps}"]
    summary = drive(tmp_path, "loop", "left", start, before_the_wall_ends_s, settings)
    assert summary["method"] == "ball"
    assert not summary["collided"]
    assert not summary["stopped"]
    assert summary["mean_abs_error_m"] < error_m
    assert summary["mean_speed_mps"] > 1.5
