"""Settings that change while the car drives: obeyed from the next scan on, and nothing that was learnt is lost."""

import math

import numpy as np
import pytest

from tests.runtime.control.scans import CAR, MIDDLE, SCAN_S, scan_of
from tests.runtime.in_earnest import is_same, judged
from wallride.drivers.api import MotorState
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.report.laws import ReportTurn
from wallride.runtime.control.safety.swept import ON_LIDAR
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.virtual.devices import BEAMS, ranges_between_walls
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world


class Drive:
    """Laws that are shown the same corridor, scan after scan, while the car rolls along it."""

    def __init__(self, left_m=1.2, right_m=1.2, ahead_m=math.nan, age_s=0.0, **sections):
        self.settings = Settings.model_validate(sections)
        self.ranges_m = ranges_between_walls(left_m, right_m, ahead_m)
        self.laws = LiveLaws(self.settings.wall_follow, self.settings.safety, CAR)
        self.scans = 0
        self.age_s = age_s
        self.speed_mps = 1.0
        self.way_m = 0.0

    def tune(self, **sections):
        tree = self.settings.model_dump()
        for section, values in sections.items():
            tree[section] = {**({} if "method" in values else tree[section]), **values}
        self.settings = Settings.model_validate(tree)
        self.laws.tune(self.settings.wall_follow, self.settings.safety)

    def scan(self):
        self.scans += 1
        at_s = self.scans * SCAN_S
        self.way_m += self.speed_mps * SCAN_S
        motor = MotorState(at_s, self.speed_mps, self.way_m, 0.0)
        scan = scan_of(self.ranges_m, at_s, self.scans, late_s=self.age_s)
        assessment = self.laws.look(scan, motor)
        return self.laws.follow(scan, motor), assessment

    @property
    def has_ball(self):
        return self.laws.path_m is not None

    def soil(self, first, last):
        """Dirty the window before these beams, and drive until that is learnt."""
        self.ranges_m[first:last] = 0.06
        for _ in range(120):
            self.scan()
            self.laws.learn()

    def steering_rad(self):
        return self.scan()[0].drive.steering_rad


@pytest.mark.parametrize("method", ["ball", "report"])
def test_a_new_gain_steers_at_the_very_next_scan(method):
    drive = Drive(left_m=1.05, wall_follow={"method": method, "kp": 0.2})
    before = drive.steering_rad()
    drive.tune(wall_follow={"method": method, "kp": 1.0})
    assert drive.steering_rad() - before == pytest.approx(0.8 * 0.05, abs=0.005), "0.8 more, for an error of 0.05 m"


class Tuned:
    """Laws of a simulated car whose settings change at given times."""

    def __init__(self, *changes):
        """changes: time [s], section, values."""
        self.settings = Settings()
        self.laws = LiveLaws(self.settings.wall_follow, self.settings.safety, CAR)
        self.changes = list(changes)

    def follow(self, scan, motor):
        while self.changes and scan.stamp_s >= self.changes[0][0]:
            _, section, values = self.changes.pop(0)
            tree = self.settings.model_dump()
            tree[section] |= values
            self.settings = Settings.model_validate(tree)
            self.laws.tune(self.settings.wall_follow, self.settings.safety)
        return self.laws.follow(scan, motor)

    def look(self, scan, motor):
        return self.laws.look(scan, motor)

    def learn(self):
        self.laws.learn()


@pytest.mark.parametrize("change", [{}, {"kp": 10.0}, {"side": "right"}], ids=["none", "gain", "side"])
def test_the_learnt_steering_offset_survives_a_change_and_is_mirrored_with_the_side(change):
    """In the middle of a corridor 2 m wide both sides are 1 m away; without its offset the car leaves it by 15 mm."""
    vehicle = VehicleSettings(trim_rad=0.05)
    case = Case(load_world("corridor"), start_speed_mps=1.0, duration_s=9.0, vehicle=vehicle)
    done = drive(case, Tuned((7.0, "wall_follow", change)), None)
    assert np.abs(done.error_m[done.time_s > 5.0]).max() < 0.005


def test_on_the_other_side_the_other_wall_is_followed():
    drive = Drive(left_m=1.05, right_m=1.05)
    drive.tune(wall_follow={"side": "right"})
    guidance, _ = drive.scan()
    assert guidance.drive.steering_rad < 0, "to the right, where the wall is too far away now"
    assert guidance.error_m == pytest.approx(0.05, abs=0.01)


def test_a_lost_wall_is_searched_for_as_the_new_settings_say():
    drive = Drive()
    drive.ranges_m = np.full(BEAMS, np.nan, np.float32)
    assert drive.scan()[0].reason == "no wall: going on slowly"
    drive.tune(wall_follow={"no_wall": "stop"})
    assert drive.scan()[0].drive is None


def test_another_method_is_a_new_law():
    drive = Drive()
    drive.tune(wall_follow={"method": "report"}, safety={"method": "report"})
    drive.scan()
    assert not drive.has_ball
    assert isinstance(drive.laws.follower, ReportTurn)
    assert judged(drive.scan()[1], 1.0, 0.0).reason == "clear", "the report's own word"
    assert drive.laws.words == ()
    drive.tune(wall_follow={"method": "ball"}, safety={"method": "swept"})
    drive.scan()
    assert drive.has_ball
    assert drive.laws.guard.body.settings is drive.laws.safety


def test_the_reports_law_is_under_the_limit_of_sensing():
    drive = Drive(wall_follow={"method": "report"}, safety={"method": "report"})
    assert judged(drive.scan()[1], 1.0, 0.0).forward_mps == math.inf
    drive.ranges_m[MIDDLE - 120 : MIDDLE + 120] = 0.03
    assert is_same(judged(drive.scan()[1], 1.0, 0.0), ON_LIDAR)
    drive.ranges_m[MIDDLE - 120 : MIDDLE + 120] = math.nan
    drive.scan()
    for _ in range(4):
        verdict = judged(drive.scan()[1], 1.0, 0.0)
    assert (verdict.forward_mps, verdict.reason) == (0.0, "the lidar is blind ahead: uncover it")
    stale = Drive(wall_follow={"method": "report"}, safety={"method": "report"}, age_s=0.4)
    assert judged(stale.scan()[1], 1.0, 0.0).reason == "the scan is too old"


def test_a_wider_margin_slows_the_car_at_once():
    drive = Drive(ahead_m=1.6)
    allowed_mps = judged(drive.scan()[1], 2.0, 0.0).forward_mps
    assessment = drive.scan()[1]
    drive.tune(safety={"graded_share": 0.2})
    assert judged(assessment, 2.0, 0.0).forward_mps < allowed_mps, "also the one in force becomes stricter"
    assert judged(drive.scan()[1], 2.0, 0.0).forward_mps < allowed_mps


def test_the_guard_keeps_what_it_knows():
    drive = Drive()
    drive.soil(250, 265)
    guard = drive.laws.guard
    memory, movers, mask = guard.memory, guard.perception.movers, guard.perception.health.mask
    assert mask is not None
    drive.speed_mps = 0.0
    drive.tune(safety={"grip_mu": 0.6, "window": {"memory_m": 0.7}})
    drive.scan()
    drive.laws.learn()
    assert drive.laws.guard is guard
    assert (guard.memory, guard.perception.movers) == (memory, movers)
    assert guard.perception.health.mask is not None
    assert np.array_equal(guard.perception.health.mask, mask), "a standing car keeps the dirt that it has learnt"
    assert guard.body.grip_mps2 == pytest.approx(0.6 * 9.81)


def test_the_window_is_judged_anew_at_the_next_scan_although_the_car_has_hardly_moved():
    drive = Drive()
    drive.soil(150, 500)
    drive.speed_mps = 0.0
    drive.tune(safety={"doubtful_mps": 0.7})
    drive.scan()
    drive.laws.learn()
    health = drive.laws.guard.perception.health
    assert health.ceiling_mps == 0.0, "more than a quarter of the window is dirty"
    drive.tune(safety={"window": {"refused_share": 0.9}})
    drive.scan()
    drive.laws.learn()
    assert health.ceiling_mps == 0.7


def backs_out_at_s(duration_s, *changes):
    """Return when a car before a dead end, which is boxed in after 1.1 s, begins to back out; None if it does not."""
    car = Tuned(*changes)
    done = drive(Case(load_world("dead_end"), start=Pose(10.8, 0.0, 0.0), duration_s=duration_s), car, car)
    backing = [float(at_s) for at_s, why in zip(done.time_s, done.reasons, strict=True) if why.startswith("backing")]
    return backing[0] if backing else None


def test_backing_out_can_be_switched_off_and_on():
    assert backs_out_at_s(4.0) == pytest.approx(3.1, abs=0.1), "after boxed_for_s"
    off_and_on = (0.0, "safety", {"backs_out": False}), (5.0, "safety", {"backs_out": True})
    assert 5.0 < backs_out_at_s(8.0, *off_and_on) < 7.5


def test_patience_can_be_changed_while_it_lasts():
    longer = (2.0, "safety", {"recovery": {"boxed_for_s": 4.0}})
    assert backs_out_at_s(6.0, longer) == pytest.approx(1.1 + 4.0, abs=0.1), "counted from where the wait began"


def test_the_same_settings_again_change_nothing():
    drive = Drive()
    drive.scan()
    before = drive.laws.guard.body
    drive.tune()
    assert drive.laws.guard.body is before


def test_the_reports_laws_take_new_settings_and_have_nothing_to_learn():
    report = {"method": "report"}
    drive = Drive(ahead_m=1.4, wall_follow=report, safety=report)
    assert drive.scan()[0].reason == "obstacle ahead: turning away"
    drive.laws.learn()
    drive.laws.remember_own_parts(None)
    assert drive.laws.own_parts is None
    drive.tune(wall_follow={**report, "speed_mps": 0.5}, safety={**report, "turn_below_m": 1.0})
    guidance, _ = drive.scan()
    assert (guidance.drive.speed_mps, guidance.reason) == (0.5, "corner ahead")
