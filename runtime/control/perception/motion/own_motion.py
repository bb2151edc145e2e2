"""The car's own motion from scan to scan: by wheels and steering with tyres, corrected by the scans themselves.

Steering alone is not enough: a trim of 0.02 rad turns the car by 0.06 rad in a metre, and what is left of a bend's slip
as much. Each scan's place is predicted from the last one, which its own scan has corrected by then.
"""

import cmath
import math
from collections.abc import Callable
from functools import cache, partial
from typing import Final, NamedTuple

from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.geometry import Places
from wallride.runtime.control.perception.motion.scan_matching import SLIDE, ScanPose, Surfaces, match, surfaces_of
from wallride.runtime.control.perception.motion.trim import SteeringTrim
from wallride.runtime.control.perception.odometry import dead_reckon
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.tyres import Moving, Tyres
from wallride.runtime.control.vehicle import GRAVITY_MPS2

KEYFRAME_S: Final = 0.5
KEYFRAME_M, KEYFRAME_RAD = 0.6, 0.4
SLIDE_KEYFRAME_M, SLIDE_KEYFRAME_RAD = 0.3, 0.2
"""Maximum age, distance and turn of the scan that the others are compared with, and those of a car that slides."""
CARRIED_S: Final = 0.15
"""Longest time for which a report is carried on to a scan."""


class DrivenPlace(NamedTuple):
    """The car at a scan, in a frame of the odometry's own.

    turn: its heading as a direction. turn_radps: its yaw rate. way_m: that its wheels have rolled.
    """

    stamp_s: float
    at_m: complex
    turn: complex
    turn_radps: float
    way_m: float

    def in_frame_m(self, places_m: Places) -> Places:
        """Return places (n,) of base_link in the frame."""
        return self.at_m + places_m * self.turn

    def in_base_m(self, places_m: Places) -> Places:
        """Return places (n,) of the frame in base_link."""
        return (places_m - self.at_m) * self.turn.conjugate()

    @property
    def pose(self) -> ScanPose:
        """Return the place without its motion."""
        return ScanPose(self.at_m, cmath.phase(self.turn))

    def at(self, pose: ScanPose) -> "DrivenPlace":
        """Return the same motion at another pose."""
        return self._replace(at_m=pose.at_m, turn=cmath.rect(1.0, pose.yaw_rad))


class OwnMotion(NamedTuple):
    """here: the car at this scan, by the wheels from `before`, its place at the last scan, which that has corrected.

    sure: whether the last scan told its shift to the side and its turn, so that lateral motions of half the usual size
    can be told from errors of the odometry. trim_rad: the learnt true angle of wheels that are told to be straight.
    rolled: the place by the wheels' present angle from `before`, without slip and lag: on a real car the assumed lag
    erred by up to 0.024 rad from scan to scan, in which what stands walks.
    """

    here: DrivenPlace
    before: DrivenPlace
    sure: bool
    trim_rad: float
    rolled: ScanPose


class MatchedOdometry:
    """Call `look` for every scan, and `learn` after its answer. tyres: as assumed.

    slid: the way from the last scan to this one as the scans tell it, where the wheels are locked; else None.
    """

    def __init__(self, tyres: Tyres) -> None:
        self.tyres = tyres
        self.slid: ScanPose | None = None
        self._here = self._before = DrivenPlace(-math.inf, 0j, 1 + 0j, 0.0, 0.0)
        self._since_s = 0.0
        self._per_s: ScanPose | None = None
        self._rolled = ScanPose()
        self._speed_mps, self._told_rad = 0.0, math.nan
        self._trim = SteeringTrim()
        self._sure = False
        self._key: tuple[Surfaces, ScanPose, float] | None = None

    def later(self, stamp_s: float, motor: MotorState | None) -> Callable[[], OwnMotion]:
        """Return what tells the motion to this scan, computed once, when it is asked first: before `learn`."""
        return cache(partial(self.look, stamp_s, motor))

    def look(self, stamp_s: float, motor: MotorState | None) -> OwnMotion:
        """Return the motion to this scan."""
        if motor is not None and not math.isfinite(motor.distance_m + motor.speed_mps + motor.steering_rad):
            motor = None
        before, told_rad = self._here, self._told_rad
        self._before = before
        self._since_s = stamp_s - before.stamp_s
        self._speed_mps, self._told_rad, way_m, turn_radps = 0.0, math.nan, before.way_m, 0.0
        if motor is not None:
            self._speed_mps, self._told_rad = motor.speed_mps, motor.steering_rad
            way_m = motor.distance_m + motor.speed_mps * min(max(stamp_s - motor.stamp_s, 0.0), CARRIED_S)
            turn_radps = self.tyres.turn_radps(motor.steering_rad, motor.speed_mps, 0.0)
        rolled = before.pose
        if motor is None or math.isnan(told_rad) or self._since_s <= 0.0:
            self._here = before._replace(stamp_s=stamp_s, turn_radps=turn_radps, way_m=way_m)
        else:
            self._here = self._moved(stamp_s, way_m, told_rad)
            step = dead_reckon(0.0, 0.0, 0.0, way_m - before.way_m, motor.steering_rad, self.tyres.wheelbase_m)
            rolled = rolled.placed(ScanPose(complex(*step[:2]), step[2]))
        self._rolled = rolled
        return OwnMotion(self._here, before, self._sure, self._trim.rad, rolled)

    def _moved(self, stamp_s: float, way_m: float, told_rad: float) -> DrivenPlace:
        """Return the place at a later scan. told_rad: angle that the wheels were told at the last one."""
        last = self._here
        speed_mps = (way_m - last.way_m) / self._since_s
        moving = Moving(last.at_m, cmath.phase(last.turn), speed_mps, last.turn_radps, self._trim.rad)
        then = moving.later(self._since_s, told_rad, self.tyres)
        turn = cmath.rect(1.0, then.yaw_rad)
        return DrivenPlace(stamp_s, then.place_m, turn, then.turn_radps, way_m)

    def learn(self, view: View, *, lost: bool = False) -> None:
        """Correct the place by comparing its scan with an earlier one, and learn the trim.

        lost: the wheels are locked, so that the odometry stands.
        """
        here, self._sure, self.slid = self._here, False, None
        lost = lost or math.isnan(self._told_rad)
        if lost:
            self._slide(view)
        elif self._key is not None and self._key[0].flat.size == view.ranges_m.size:
            surfaces, key_pose, _ = self._key
            found = match(view, surfaces, self._rolled.seen_from(key_pose))
            if found is not None:
                self._here, self._sure = here.at(key_pose.placed(found[0])), found[1]
        if not lost:
            now = Moving(0j, self._here.pose.yaw_rad, self._speed_mps, here.turn_radps, self._trim.rad)
            self._trim.learn(now, self._told_rad, self._since_s if self._sure else 0.0, self.tyres)
            if not self._compares_with_key():
                self._key = surfaces_of(view), self._here.pose, here.stamp_s
        self._note_speed()

    def _slide(self, view: View) -> None:
        """Follow a car whose wheels tell nothing: the floor slows it, and the scans tell where it is."""
        key, before = self._key, self._before.pose
        if key is not None and self._per_s is not None and key[0].flat.size == view.ranges_m.size:
            slower_mps = self.tyres.mu * GRAVITY_MPS2 * self._since_s
            share = self._since_s * max(0.0, 1.0 - slower_mps / max(abs(self._per_s.at_m), 1e-6))
            went = ScanPose(share * self._per_s.at_m, share * self._per_s.yaw_rad)
            found = match(view, key[0], before.placed(went).seen_from(key[1]), SLIDE)
            if found is not None:
                self._here = self._here.at(key[1].placed(found[0]))
                self.slid = self._here.pose.seen_from(before)
        if self.slid is None or not self._compares_with_key(SLIDE_KEYFRAME_M, SLIDE_KEYFRAME_RAD):
            self._key = surfaces_of(view), self._here.pose, self._here.stamp_s

    def _note_speed(self) -> None:
        """Note how the car goes; None after a gap, and after a slide that the scans have not told."""
        known = self.slid is not None or not math.isnan(self._told_rad)
        if not (known and 0.0 < self._since_s <= CARRIED_S):
            self._per_s = None
            return
        step = self._here.pose.seen_from(self._before.pose)
        turn_rad = math.remainder(step.yaw_rad, math.tau)
        self._per_s = ScanPose(step.at_m / self._since_s, turn_rad / self._since_s)

    def _compares_with_key(self, most_m: float = KEYFRAME_M, most_rad: float = KEYFRAME_RAD) -> bool:
        """Return whether the next scan is compared with the earlier one, too."""
        if self._key is None:
            return False
        _, key_pose, key_s = self._key
        moved = self._here.pose.seen_from(key_pose)
        near = abs(moved.at_m) < most_m and abs(math.remainder(moved.yaw_rad, math.tau)) < most_rad
        return near and 0.0 <= self._here.stamp_s - key_s < KEYFRAME_S
