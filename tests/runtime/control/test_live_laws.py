"""Settings that change while the car drives: obeyed from the next scan on, and nothing that was learnt is lost."""

import math

import numpy as np
import pytest

from drivers.api import MotorState, Scan
from runtime.control.limiter import Limiter, Limits
from runtime.control.live_laws import LiveLaws
from runtime.control.recovery.recovering_follower import RecoveringFollower
from runtime.control.recovery.way_out import Recovery
from runtime.control.report.laws import ReportGuard, ReportTurn
from runtime.control.safety.swept import SweptGuard
from runtime.control.vehicle import CarSettings
from runtime.control.wall_following.ball import BallFollower
from runtime.settings.tree import Settings
from sim.virtual.devices import BEAMS, STEP_RAD, ranges_between_walls

CAR = CarSettings()


class Drive:
    """Laws that are shown the same corridor, scan after scan, while the car rolls along it."""

    def __init__(self, left_m=1.2, right_m=1.2, ahead_m=math.nan, **sections):
        self.settings = Settings.model_validate(sections)
        self.ranges_m = ranges_between_walls(left_m, right_m, ahead_m)
        self.laws = LiveLaws(self.settings.wall_follow, self.settings.safety, CAR)
        self.scans = 0
        self.speed_mps = 1.0

    def tune(self, **sections):
        tree = self.settings.model_dump()
        for section, values in sections.items():
            tree[section] = {**({} if "method" in values else tree[section]), **values}
        self.settings = Settings.model_validate(tree)
        self.laws.tune(self.settings.wall_follow, self.settings.safety)

    def scan(self):
        self.scans += 1
        at_s = self.scans * 0.025
        motor = MotorState(at_s, self.speed_mps, at_s * self.speed_mps, 0.0, 11.8, 0.0, 0.0, 25.0, "", False, False)
        scan = Scan(at_s, at_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, self.ranges_m, self.scans)
        outlook = self.laws.look(scan, motor)
        return self.laws.follow(scan, motor), outlook

    @property
    def ball(self) -> BallFollower:
        assert isinstance(self.laws._driver, BallFollower)
        return self.laws._driver

    @property
    def swept(self) -> SweptGuard:
        assert isinstance(self.laws.guard, SweptGuard)
        return self.laws.guard

    @property
    def recovery(self) -> Recovery:
        assert self.laws._recovery is not None
        return self.laws._recovery

    def steering_rad(self):
        return self.scan()[0].drive.steering_rad


@pytest.mark.parametrize("method", ["ball", "report"])
def test_a_new_gain_steers_at_the_very_next_scan(method):
    drive = Drive(left_m=1.05, wall_follow={"method": method, "kp": 0.2})
    before = drive.steering_rad()
    drive.tune(wall_follow={"method": method, "kp": 1.0})
    assert drive.steering_rad() - before == pytest.approx(0.8 * 0.05, abs=0.005), "0.8 more, for an error of 0.05 m"


def learn_trim(track, trim_rad):
    """Let it know what a crooked car would have taught it."""
    track._state = (*track._state[:2], trim_rad, *track._state[3:])


def test_what_the_follower_learnt_survives_a_new_gain():
    drive = Drive(left_m=1.05)
    for _ in range(40):
        drive.scan()
    driver, track, bias_m = drive.ball, drive.ball._track, drive.ball._bias_m
    learn_trim(track, 0.02)
    drive.tune(wall_follow={"kp": 0.4})
    assert drive.ball is driver
    assert drive.ball._track is track
    assert (track.trim_rad, drive.ball._bias_m) == (0.02, bias_m)


def test_on_the_other_side_the_other_wall_is_followed_with_the_learnt_offset_mirrored():
    drive = Drive(left_m=1.05, right_m=1.05)
    for _ in range(40):
        drive.scan()
    track = drive.ball._track
    learn_trim(track, 0.02)
    drive.tune(wall_follow={"side": "right"})
    guidance, _ = drive.scan()
    assert guidance.drive.steering_rad < 0, "to the right, where the wall is too far away now"
    assert guidance.error_m == pytest.approx(0.05, abs=0.01)
    assert track.trim_rad == pytest.approx(-0.02, abs=0.003)


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
    assert isinstance(drive.laws.follower, ReportTurn)
    assert type(drive.laws.guard) is ReportGuard
    assert drive.laws.words == ()
    drive.tune(wall_follow={"method": "ball"}, safety={"method": "swept"})
    drive.scan()
    assert drive.ball is drive.laws._driver
    assert drive.swept.body.settings is drive.laws.safety


def test_a_wider_margin_slows_the_car_at_once():
    drive = Drive(ahead_m=1.6)
    allowed_mps = drive.scan()[1].limit(2.0, 0.0).forward_mps
    outlook = drive.scan()[1]
    drive.tune(safety={"graded_share": 0.2})
    assert outlook.limit(2.0, 0.0).forward_mps < allowed_mps, "even the judgement that is in force becomes stricter"
    assert drive.scan()[1].limit(2.0, 0.0).forward_mps < allowed_mps


def test_the_guard_keeps_what_it_knows():
    drive = Drive()
    drive.scan()
    guard = drive.swept
    memory, beams, movers = guard.memory, guard.health._beams, guard.movers
    drive.tune(safety={"grip_mu": 0.6, "window": {"masked_share": 0.05}})
    assert drive.swept is guard
    assert guard.memory is memory
    assert (guard.health._beams, guard.movers) == (beams, movers)
    assert guard.body.grip_mps2 == pytest.approx(0.6 * 9.81)


def test_the_window_is_judged_anew_at_the_next_scan_although_the_car_has_hardly_moved():
    drive = Drive()
    drive.speed_mps = 0.0
    drive.scan()
    health = drive.swept.health
    health._moved_m = 10.0
    health._beams.dirt[150:400] = 1.0
    health._beams.dirty[150:400] = True
    drive.tune(safety={"doubtful_mps": 0.7})
    drive.scan()
    drive.laws.learn()
    assert health.ceiling_mps == 0.0, "more than a quarter of the window is dirty"
    drive.tune(safety={"window": {"refused_share": 0.9}})
    drive.scan()
    drive.laws.learn()
    assert health.ceiling_mps == 0.7


def test_backing_out_can_be_switched_off_and_on():
    drive = Drive()
    assert isinstance(drive.laws.follower, RecoveringFollower)
    assert drive.recovery._settings.tries == 6
    drive.tune(safety={"backs_out": False})
    assert drive.recovery._settings.tries == 0
    drive.tune(safety={"backs_out": True})
    assert drive.recovery._settings.tries == 6


def test_patience_can_be_changed_while_it_lasts():
    drive = Drive()
    recovery = drive.recovery
    recovery._since_s = 1.0
    drive.tune(safety={"recovery": {"boxed_for_s": 5.0}})
    assert drive.recovery is recovery
    assert (recovery._since_s, recovery._settings.boxed_for_s) == (1.0, 5.0)


def test_the_same_settings_again_change_nothing():
    drive = Drive()
    drive.scan()
    before = drive.swept.body
    drive.tune()
    assert drive.swept.body is before


def test_a_lower_top_speed_is_obeyed_at_once_and_a_higher_one_by_and_by():
    limiter = Limiter(Limits(4.0, 1.0, 0.34, 3.2, 4.0))
    assert limiter.limit(3.0, 0.0, 10.0).speed_mps == 3.0
    limiter.tune(Limits(1.0, 1.0, 0.34, 3.2, 4.0))
    assert limiter.limit(3.0, 0.0, 0.02).speed_mps == 1.0
    limiter.tune(Limits(4.0, 1.0, 0.34, 3.2, 4.0))
    assert limiter.limit(3.0, 0.0, 0.02).speed_mps == pytest.approx(1.08)
