"""The function-level loop: what it does with time, contacts and stops."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import Verdict
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.report.laws import ReportFollower, ReportGuard
from wallride.runtime.control.report.settings import ReportFollowSettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.virtual.closed_loop import FULL_BRAKE_MPS2, Case, as_scan, drive
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.obstacles import ConstantMotion, person, sudden_box
from wallride.sim.world.place import wall_distances_m
from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.worlds import load_world

FLOOR_MPS2 = VehicleSettings().grip_mu * 9.81
"""What the floor holds, however hard the brake pulls."""

QUIET = LidarSettings(noise_std_m=0.0)


@dataclass
class Scripted:
    """Steers and drives by the scan's time."""

    speed_mps: float = 1.0
    steering_rad: float = 0.0
    from_s: float = 0.0

    def follow(self, scan, motor):
        steering_rad = self.steering_rad if scan.stamp_s >= self.from_s else 0.0
        return Guidance(Drive(self.speed_mps, steering_rad), math.nan, math.nan, math.nan, "script")


@dataclass
class Stopper:
    """Says stop from a time on, and how hard."""

    from_s: float
    brake_mps2: float

    def look(self, scan, motor):
        cap_mps = 0.0 if scan.stamp_s >= self.from_s else math.inf
        return Verdict(cap_mps, cap_mps, "told to", math.nan, self.brake_mps2)

    def learn(self):
        pass


def report_run(seed):
    case = Case(load_world("straight"), None, 1.0, duration_s=2.0, seed=seed)
    return drive(case, ReportFollower(ReportFollowSettings()), ReportGuard(CarSettings()))


def test_same_seed_same_run_bit_by_bit():
    first, again, other = report_run(1), report_run(1), report_run(2)
    assert np.array_equal(first.pose, again.pose)
    assert np.array_equal(first.command, again.command)
    assert not np.array_equal(first.command, other.command)


def test_a_wall_in_front_stops_the_report_guard_before_contact():
    done = drive(Case(load_world("dead_end"), None, 1.0, standing_s=1.0), Scripted(1.0), ReportGuard(CarSettings()))
    assert done.contact is None
    assert [stop.reason for stop in done.stops] == ["obstacle ahead"]
    assert done.speed_mps[-1, 0] == 0.0
    assert 12.0 - done.pose[-1, 0] - CAR.front_m == pytest.approx(0.933 - 0.15, abs=0.15)


def test_nobody_looking_out_ends_in_contact_at_full_speed():
    done = drive(Case(load_world("dead_end"), None, 2.0), Scripted(2.0), None)
    assert done.contact is not None
    assert done.contact.speed_mps == pytest.approx(2.0, abs=0.05)
    assert done.contact.pose.x_m + CAR.front_m == pytest.approx(12.0, abs=2.0 * 0.0025 + 1e-6)


def first_turn_s(latency_s):
    """When the wheels of a car that is told to steer at 0.5 s begin to turn it, from its heading."""
    world = load_world("straight")
    case = Case(world, None, 1.0, duration_s=1.0, lidar=QUIET, latency_s=latency_s)
    done = drive(replace(case, lidar=QUIET.model_copy(update={"rate_hz": 400.0})), Scripted(1.0, 0.3, 0.5), None)
    return float(done.time_s[np.flatnonzero(done.pose[:, 2] != 0.0)[0]])


@pytest.mark.parametrize("latency_s", [0.0, 0.02, 0.06])
def test_the_wheels_turn_latency_and_servo_delay_after_the_scan(latency_s):
    due_s = 0.5 + latency_s + VehicleSettings().steering_delay_s
    assert first_turn_s(latency_s) == pytest.approx(due_s, abs=0.006)


@pytest.mark.parametrize("brake_mps2", [1.5, 3.0, math.inf])
def test_a_stop_brakes_as_hard_as_allowed(brake_mps2):
    case = Case(load_world("straight"), None, 3.0, duration_s=3.0, standing_s=0.5, lidar=QUIET)
    done = drive(case, Scripted(3.0), Stopper(0.5, brake_mps2))
    stop = done.stops[0]
    at_stop = np.flatnonzero(done.time_s >= stop.from_s)[0]
    braking_m = done.pose[-1, 0] - done.pose[at_stop, 0] - 3.0 * (case.latency_s + case.vehicle.drive_delay_s)
    assert 3.0**2 / (2 * braking_m) == pytest.approx(min(brake_mps2, FULL_BRAKE_MPS2, FLOOR_MPS2), rel=0.04)
    assert math.isnan(stop.until_s)


def test_too_slow_a_command_is_a_stop_and_the_motor_reports_its_wheels():
    done = drive(Case(load_world("straight"), None, 1.0, duration_s=2.0, lidar=QUIET), Scripted(0.15), None)
    assert done.command[:, 0].max() == 0.0
    assert done.speed_mps[-1].tolist() == [0.0, 0.0]


def test_a_sudden_obstacle_is_counted_from_the_scan_that_shows_it():
    case = Case(load_world("straight"), None, 1.0, duration_s=3.0, obstacles=(sudden_box(0.5, from_s=1.0),))
    done = drive(case, Scripted(1.0), None)
    shown = int(np.flatnonzero(done.appeared)[0])
    assert done.time_s[shown] == pytest.approx(1.0)
    assert done.clearance_m[shown] == pytest.approx(0.35, abs=1e-6)
    assert done.contact is not None
    assert done.contact.time_s == pytest.approx(1.35, abs=0.01)


def test_a_person_can_walk_into_a_standing_car():
    walker = person(0.2, -2.0, ConstantMotion(0.0, 1.0, 0.0))
    done = drive(Case(load_world("straight"), duration_s=5.0, obstacles=(walker,)), Scripted(0.0), None)
    assert done.contact is not None
    assert done.contact.speed_mps == 0.0
    assert done.contact.time_s == pytest.approx(2.0 - 0.2 - CAR.half_width_m, abs=0.02)


def test_a_run_ends_with_its_way_its_time_or_a_standstill():
    world = load_world("straight")
    assert drive(Case(world, None, 2.0, distance_m=3.0), Scripted(2.0), None).distance_m == pytest.approx(3.0, abs=0.01)
    assert drive(Case(world, None, 1.0, duration_s=1.0), Scripted(), None).time_s[-1] == pytest.approx(1.0)
    stood = drive(Case(world, None, 1.0, standing_s=1.5), Scripted(0.0), None)
    assert 1.5 < stood.time_s[-1] < 2.5


def test_true_wall_distance_knows_the_side():
    world = load_world("straight")
    poses = np.array([[0.0, 0.0, 0.1], [1.0, -0.4, -0.2]])
    assert wall_distances_m(world, poses, "left") == pytest.approx([1.0, 1.4], rel=1e-4)
    assert wall_distances_m(world, poses, "right") == pytest.approx([3.0, 2.6], rel=1e-4)


def test_a_scan_reads_as_the_driver_would():
    reported = np.array([65533, 19, 20, 1234, 30000, 30001])
    scan = as_scan(reported, LidarSettings(beams=6), 1.5, 7)
    assert np.isnan(scan.ranges_m).tolist() == [True, True, False, False, False, True]
    assert scan.ranges_m[3] == np.float32(1.234)
    assert (scan.angle_min_rad, scan.sequence, scan.stamp_s) == (math.radians(-135), 7, 1.5)
    assert scan.angle_step_rad == pytest.approx(math.radians(54))
    assert 5 * scan.ray_s == pytest.approx(0.01875), "its beams were measured one after the other"
    assert as_scan(reported, LidarSettings(beams=6, motion_skew=False), 1.5, 7).ray_s == 0.0


def test_a_right_hand_run_is_the_mirror_of_the_left_hand_one():
    left = Case(load_world("straight"), Pose(0, 0, 0.1), 1.0, duration_s=1.0, lidar=QUIET)
    right = replace(left, world=load_world("straight", side="right"), start=Pose(0, 0, -0.1))
    runs = [
        drive(case, ReportFollower(ReportFollowSettings(side=side)), None)
        for case, side in ((left, "left"), (right, "right"))
    ]
    assert runs[0].pose[:, 1] == pytest.approx(-runs[1].pose[:, 1], abs=2e-3)
