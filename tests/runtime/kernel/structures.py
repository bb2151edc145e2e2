"""From the flat arguments of a C function to the structures that its Python takes: tests make arrays and numbers."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from wallride.runtime.calibration.scan_motion import ReferenceScan
from wallride.runtime.control.localization.line_field import LineField
from wallride.runtime.control.localization.scan_points import AxleMotion, Beams, ScanPoints
from wallride.runtime.control.perception.motion.scan_matching import ScanPose, Surfaces
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.window_dirt import Evidence, LearningShares
from wallride.runtime.control.safety.footprint import AxlePath, Outline
from wallride.runtime.control.safety.manoeuvre_rollout import RolloutStart
from wallride.runtime.control.safety.promised_way import Roadworthy
from wallride.runtime.control.wall_following.ball_law import Aim, Steered
from wallride.runtime.control.wall_following.ball_path import Ball, BallPath
from wallride.runtime.control.wall_following.followed_wall import FollowedWall
from wallride.runtime.control.wall_following.prediction import Shift
from wallride.runtime.control.wall_following.wall_fit import CLEAN_INLIERS, WallLine


def _laying(ends_m, ahead, alone, near, far, normals, offsets_m, free, *numbers):
    corner_x_m, corner_y_m, cell_m, rows, columns, *pose, before, prior = numbers
    points = ScanPoints(ends_m, ahead, alone)
    corner_m = complex(corner_x_m, corner_y_m)
    field = LineField(corner_m, cell_m, rows, columns, near, far, normals, offsets_m, free)
    return field, points, tuple(pose), before, prior


def _looked_at(ranges_m, ahead, age_s, farthest_m, step_rad, lidar_x_m, lidar_y_m, *motion):
    scan = SimpleNamespace(ranges_m=ranges_m, range_max_m=farthest_m, angle_step_rad=step_rad)
    return scan, Beams(1, ahead, age_s), complex(lidar_x_m, lidar_y_m), AxleMotion(*motion)


def _matched(x_m, y_m, ranges_m, solid, *numbers):
    lidar_x_m, lidar_y_m, first_rad, step_rad, points_m, normals, flat, at_x_m, at_y_m, yaw_rad, *drift = numbers
    scan = SimpleNamespace(angle_min_rad=first_rad, angle_step_rad=step_rad)
    lidar_m = complex(lidar_x_m, lidar_y_m)
    view = SimpleNamespace(scan=scan, x_m=x_m, y_m=y_m, ranges_m=ranges_m, solid=solid, lidar_m=lidar_m)
    return view, Surfaces(points_m, normals, flat), ScanPose(complex(at_x_m, at_y_m), yaw_rad), tuple(drift)


def _laid_over(x_m, y_m, key_x_m, key_y_m, normal_x, normal_y, usable, first_rad, step_rad, *numbers):
    key = ReferenceScan(np.stack([key_x_m, key_y_m]), np.stack([normal_x, normal_y]), usable)
    return key, np.stack([x_m, y_m]), np.array(numbers[:3]), (first_rad, step_rad, usable.size), numbers[3]


def _lines(beams, rear, front):
    return SimpleNamespace(beams=beams, rear=rear, front=front)


def _fit(x_m, y_m, range_m, usable, beams, rear, front, expected_m, expected_rad):
    return x_m, y_m, range_m, usable, _lines(beams, rear, front), WallLine(expected_m, expected_rad, 0)


def _wall(
    x_m, y_m, range_m, solid, no_echo, start, stop, opposite_from, gap_m, beams, rear, front, line_m, line_rad,
    desired_m,
):  # fmt: skip
    side = SimpleNamespace(opposite_from=opposite_from, lines=_lines(beams, rear, front))
    seen = SimpleNamespace(side=side, x_m=x_m, y_m=y_m, range_m=range_m, solid=solid, no_echo=no_echo)
    return seen, slice(start, stop), gap_m, WallLine(line_m, line_rad, 0), desired_m


def _ball(x_m, y_m, solid, wall, glass_m, at_x, at_y, yaw, line_m, line_rad, bias_m, noise_m, desired_m, radii_m):
    line = WallLine(line_m, line_rad, CLEAN_INLIERS + 1)
    seen = SimpleNamespace(x_m=x_m, y_m=y_m, solid=solid)
    ball = Ball(bias_m, noise_m, desired_m)
    return seen, FollowedWall(wall, line, desired_m, -1), glass_m, Shift(at_x, at_y, yaw), ball, radii_m


def _drive(radius_m, bearing_rad, meets, crosses, *numbers):
    path = BallPath(radius_m, bearing_rad, meets, crosses)
    return path, Aim(*numbers[:5]), Steered(*numbers[5:10]), *numbers[10:]


def _motion(told, wire, motor_s, speed_mps, steering_rad, servo_rad, scan_s, since_s, ahead_s, wheelbase_m, trim, rate):
    motor = SimpleNamespace(stamp_s=motor_s, speed_mps=speed_mps, steering_rad=steering_rad)
    answers = SimpleNamespace(told=told, wire=wire, rate_radps=rate)
    return answers, motor, servo_rad, (scan_s, since_s, ahead_s), wheelbase_m, trim


def _dirt(ranges_m, no_echo, own, rear, near_m, dirt, body, blind, learns, quickly, turned):
    view = SimpleNamespace(ranges_m=ranges_m, no_echo=no_echo, own=own)
    return view, rear, Evidence(near_m, dirt, body, blind), LearningShares(learns, quickly, turned)


def _thin(x_m, y_m, solid, ranges_m, dirty, angle_min_rad, angle_step_rad, at_x_m, at_y_m, yaw_rad):
    scan = SimpleNamespace(angle_min_rad=angle_min_rad, angle_step_rad=angle_step_rad)
    view = SimpleNamespace(scan=scan, x_m=x_m, y_m=y_m, solid=solid, ranges_m=ranges_m, dirty=dirty)
    return view, OdometryState(at_x_m, at_y_m, yaw_rad)


def _sectors(
    ranges_m, x_m, y_m, no_echo, own, dirty, state, held, first, beams, first_rad, width_rad, lidar_x_m, lidar_y_m,
    front_m, half_width_m, within_m, moved_x_m, moved_y_m, turned_rad,
):  # fmt: skip
    lidar_m = complex(lidar_x_m, lidar_y_m)
    view = SimpleNamespace(ranges_m=ranges_m, x_m=x_m, y_m=y_m, no_echo=no_echo, own=own, dirty=dirty, lidar_m=lidar_m)
    sectors = SimpleNamespace(first=first, beams=beams, first_rad=first_rad, width_rad=width_rad)
    car = SimpleNamespace(front_m=front_m, half_width_m=half_width_m)
    return view, sectors, (state, held), (complex(moved_x_m, moved_y_m), turned_rad), car, within_m


def _behind(places_m, at_x_m, at_y_m, yaw_rad, lidar_x_m, lidar_y_m, half_view_rad):
    return places_m, at_x_m, at_y_m, yaw_rad, complex(lidar_x_m, lidar_y_m), half_view_rad


def _near(x_m, y_m, solid, ranges_m, at_x_m, at_y_m, yaw_rad):
    view = SimpleNamespace(x_m=x_m, y_m=y_m, solid=solid, ranges_m=ranges_m)
    return view, complex(at_x_m, at_y_m), yaw_rad


def _dark(no_echo, solid, ranges_m, angle_min_rad, angle_step_rad, toward_rad, near_m):
    scan = SimpleNamespace(angle_min_rad=angle_min_rad, angle_step_rad=angle_step_rad)
    return SimpleNamespace(scan=scan, no_echo=no_echo, solid=solid, ranges_m=ranges_m), toward_rad, near_m


def _found(dirt, body, blind, doubted, before, mask_above, unmask_below):
    return Evidence(dirt, dirt, body, blind), doubted, before, mask_above, unmask_below


def _sweep(steering_rad, length_m, points_m, front_m, rear_m, half_width_m, *motion):
    return steering_rad, length_m, points_m, Outline(front_m, rear_m, half_width_m), motion


def _path(travel_m, place_m, heading, curvature_per_m, points_m, front_m, rear_m, half_width_m, direction):
    path = AxlePath(travel_m, place_m, heading, curvature_per_m)
    return path, Outline(front_m, rear_m, half_width_m), points_m, direction


def _rollouts(points_m, steering_rad, brake_mps2, grip_mps2, past_rad, coming_rad, *start):
    return points_m, steering_rad, brake_mps2, grip_mps2, (past_rad, coming_rad), RolloutStart(*start)


def _promise(places_m, speed_mps, look_m, *car):
    return places_m, speed_mps, Roadworthy(*car), look_m


STRUCTURES: dict[str, Callable[..., Any]] = {
    "fit_wall_line": _fit,
    "lay_on_lines": _laying,
    "ends_of_beams": _looked_at,
    "match_scan": _matched,
    "lay_over": _laid_over,
    "find_followed_wall": _wall,
    "roll_ball": _ball,
    "drive_along_ball": _drive,
    "predict_motion": _motion,
    "weigh_dirt": _dirt,
    "find_thin_places": _thin,
    "watch_sectors": _sectors,
    "find_near_places": _near,
    "places_behind": _behind,
    "find_dark_regions": _dark,
    "find_dirt": _found,
    "sweep_arc": _sweep,
    "sweep_path": _path,
    "drive_promise": _promise,
    "roll_out_all": _rollouts,
}
