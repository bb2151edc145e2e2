"""The laws in virtual time with a lidar that stops telling the truth: named, and stopped before the wall."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from tests.tiers import slow
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.perception import scene_agreement
from wallride.runtime.control.perception.plausibility import BACKWARDS, HELD_OR_TURNED, TURNED, WRONG_SCALE
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.devices.turning import TurningHead
from wallride.sim.virtual import turning_sensor
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS, Case, drive
from wallride.sim.world.beams import NO_RETURN_MM, LidarSettings
from wallride.sim.world.worlds import load_world

FROM_S = 2.0
STOPS_WITHIN_M = 0.6
"""Half a metre until it is told, and the stop."""
BEAMS = LidarSettings().beams
BEARINGS_RAD = np.radians(np.linspace(LidarSettings().first_deg, LidarSettings().last_deg, BEAMS))
NAMED = {scene_agreement.REPEATED, scene_agreement.STANDS, scene_agreement.VANISHED}


@dataclass
class Untrue:
    """A corrupter of the sensor's integers from a time on; it keeps what it has seen."""

    kind: str
    from_s: float = FROM_S
    seen: list[Any] = field(default_factory=list)
    late: int = 0

    def __call__(self, reported_mm, now_s):
        """Return what the sensor reports instead."""
        if now_s < self.from_s:
            self.seen.append(reported_mm)
            return reported_mm
        self.late += 1
        noise_mm = np.random.default_rng(self.late).integers(-3, 4, BEAMS)
        return getattr(self, f"_{self.kind}")(reported_mm, noise_mm)

    def _noisy(self, _, noise_mm):
        return self.seen[-1] + noise_mm

    def _dusty(self, _, noise_mm):
        lost = np.random.default_rng(self.late).random(BEAMS) < 0.13
        return np.where(lost, NO_RETURN_MM, self.seen[-1] + noise_mm)

    def _flickering(self, _, __):
        frozen_mm = self.seen[-1].copy()
        frozen_mm[300] += self.late % 2 * 500
        return frozen_mm

    def _looped(self, _, __):
        return self.seen[-40 + self.late % 40]

    def _far_ahead(self, reported_mm, noise_mm):
        return np.where(np.abs(BEARINGS_RAD) < math.pi / 4, 29_900 + noise_mm, reported_mm)

    def _far(self, _, noise_mm):
        return 29_900 + noise_mm

    def _nine(self, _, noise_mm):
        return 9_000 + noise_mm

    def _random_ahead(self, reported_mm, _):
        return np.where(np.abs(BEARINGS_RAD) < math.pi / 4, self._random(reported_mm, None), reported_mm)

    def _random(self, _, __):
        return np.random.default_rng(self.late).integers(4_000, 29_000, BEAMS)

    def _knocked_left(self, reported_mm, _):
        return np.roll(reported_mm, -360)

    def _knocked_right(self, reported_mm, _):
        return np.roll(reported_mm, 240)


def tell(kind, world, *assignments, from_s=FROM_S, duration_s=5.0, seed=3):
    """Return the run, and the way driven from the moment on."""
    settings = load_settings(None, ["wall_follow.speed_mps=1.0", *assignments])
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    done = drive(Case(load_world(world), duration_s=duration_s, seed=seed, cover=Untrue(kind, from_s)), laws, laws)
    places = done.pose[done.time_s >= from_s, :2]
    return done, float(np.hypot(*np.diff(places, axis=0).T).sum())


@pytest.mark.parametrize("kind", ["knocked_left", "knocked_right"])
@pytest.mark.parametrize("world", ["loop", "dead_end"])
def test_a_lidar_that_is_turned_in_the_drive_stops_the_car(kind, world):
    done, way_m = tell(kind, world, from_s=3.0, duration_s=6.0)
    assert done.contact is None
    assert way_m < 1.4  # less than to the wall that it would meet then
    assert done.reasons[-1] in {BACKWARDS, WRONG_SCALE, TURNED, HELD_OR_TURNED}


NAMED_OF = {
    "noisy": {scene_agreement.STANDS},
    "dusty": {scene_agreement.STANDS},
    "flickering": {scene_agreement.REPEATED, scene_agreement.STANDS},
    "looped": {scene_agreement.REPEATED},
}


@pytest.mark.parametrize(
    ("kind", "method"),
    [
        *((kind, "swept") for kind in (*NAMED_OF, "far_ahead", "far", "nine", "random", "random_ahead")),
        *(("noisy", "report"), ("far_ahead", "report")),
    ],
)
def test_a_lidar_that_stops_telling_the_truth_is_named_and_the_car_stands_within_half_a_metre(kind, method):
    done, way_m = tell(kind, "loop", f"safety.method={method}")
    assert done.contact is None
    assert NAMED & set(done.reasons) == NAMED_OF.get(kind, {scene_agreement.VANISHED})
    assert way_m < STOPS_WITHIN_M
    assert abs(done.speed_mps[-1, 0]) < 0.05


class Blanked:
    """Laws that see one and the same far range within an angle of straight ahead, from FROM_S on."""

    def __init__(self, laws, within_rad):
        self.laws, self.within_rad, self.shown = laws, within_rad, None

    def look(self, scan, motor):
        self.shown = scan
        if scan.stamp_s >= FROM_S:
            bearings_rad = scan.angle_min_rad + scan.angle_step_rad * np.arange(scan.ranges_m.size)
            noise_m = np.random.default_rng(scan.sequence).uniform(0.0, 0.01, scan.ranges_m.size)
            blank_m = (scan.range_max_m - 0.1 + noise_m).astype(np.float32)
            self.shown = replace(
                scan, ranges_m=np.where(np.abs(bearings_rad) < self.within_rad, blank_m, scan.ranges_m)
            )
        return self.laws.look(self.shown, motor)

    def follow(self, _scan, motor):
        return self.laws.follow(self.shown, motor)

    def learn(self):
        self.laws.learn()


@pytest.mark.parametrize(
    ("word", "within_rad"),
    [("a1", math.pi / 4), ("x2", math.tau)],
)
def test_a_blank_of_a_lidar_with_fewer_beams_stops_the_car_too(word, within_rad):
    settings = load_settings(None, ["wall_follow.speed_mps=1.0"])
    laws = Blanked(LiveLaws(settings.wall_follow, settings.safety, settings.car), within_rad)
    done = drive(Case(load_world("dead_end"), duration_s=5.0, seed=3, turning=word), laws, laws)
    assert done.contact is None
    assert scene_agreement.VANISHED in done.reasons
    places = done.pose[done.time_s >= FROM_S, :2]
    assert float(np.hypot(*np.diff(places, axis=0).T).sum()) < STOPS_WITHIN_M


class StoredTurns(TurningHead):
    """Shows its last turn again between two times, each time with a noise of its own."""

    until_s = math.inf

    def _measured(self, turns, head_deg, see):
        self.frozen = FROM_S <= turns[0] / self.device.turns_hz < self.until_s
        mm = super()._measured(turns, head_deg, see)
        noise_mm = np.random.default_rng(round(100 * turns[0])).integers(-3, 4, mm.size)
        return np.where(mm > 0, mm + noise_mm, mm) if self.frozen else mm


def drive_by(word, world, seed, duration_s=7.0, beams=ROUGH_BEAMS):
    settings = load_settings(None, ["wall_follow.speed_mps=1.0"])
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    case = Case(load_world(world, seed=seed), duration_s=duration_s, seed=seed, turning=word, lidar=beams)
    return drive(case, laws, laws)


@pytest.mark.parametrize(("word", "world"), [("a1", "loop"), ("x2", "u_turn")])
def test_a_slow_lidar_that_shows_its_last_turn_again_with_a_noise_of_its_own_stops_the_car(word, world, monkeypatch):
    monkeypatch.setattr(turning_sensor, "TurningHead", StoredTurns)
    done = drive_by(word, world, 3, duration_s=5.0, beams=LidarSettings(noise_std_m=0.01))
    assert done.contact is None
    assert done.reasons[-1] == scene_agreement.STANDS
    places = done.pose[done.time_s >= FROM_S, :2]
    assert float(np.hypot(*np.diff(places, axis=0).T).sum()) < 0.9


def test_a_slow_lidar_that_measures_again_is_believed_again(monkeypatch):
    monkeypatch.setattr(turning_sensor, "TurningHead", StoredTurns)
    monkeypatch.setattr(StoredTurns, "until_s", FROM_S + 2.0)
    done = drive_by("a1", "loop", 3, duration_s=7.0, beams=LidarSettings(noise_std_m=0.01))
    assert scene_agreement.STANDS in done.reasons
    assert done.speed_mps[-1, 0] > 0.8


@pytest.mark.parametrize(("word", "world"), [("a1", "corridor"), *slow(("c1", "doorway"), ("x2", "cluttered"))])
def test_a_slow_lidar_that_tells_the_truth_is_never_doubted(word, world):
    assert not NAMED & set(drive_by(word, world, 4).reasons)


def test_walls_along_the_way_are_no_doubt_where_head_and_samples_are_in_step():
    """Each sample of a C1 lies as far beside its beam as in the turn before: the scene seems to stand."""
    done = drive_by("c1", "straight", 9, beams=LidarSettings(noise_std_m=0.01))
    assert not NAMED & set(done.reasons)


@pytest.mark.parametrize(
    ("world", "speed_mps"),
    [("dead_end", 1.0), ("corridor", 3.0), *slow(("loop", 1.0), ("doorway", 3.0), ("cluttered", 3.0))],
)
def test_a_lidar_that_tells_the_truth_is_never_doubted(world, speed_mps):
    done, _ = tell("noisy", world, f"wall_follow.speed_mps={speed_mps}", from_s=math.inf, duration_s=8.0)
    assert not NAMED & set(done.reasons)


def test_a_slow_lidar_in_a_corridor_that_tells_the_truth_is_no_doubt_of_the_motor():
    settings = load_settings(None, ["wall_follow.speed_mps=1.0"])
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    truth = Blanked(laws, 0.0)
    done = drive(Case(load_world("doorway"), duration_s=7.0, seed=1, turning="a1"), truth, truth)
    assert not {BACKWARDS, WRONG_SCALE, TURNED, HELD_OR_TURNED} & set(done.reasons)


def test_what_bends_leave_in_the_scans_of_a_slow_lidar_is_no_doubt_of_the_motor():
    done = drive_by("c1", "track:seed=5", 881)  # a long straight, which tells no way, and a bend
    assert not {BACKWARDS, WRONG_SCALE, TURNED, HELD_OR_TURNED} & set(done.reasons)


@pytest.mark.parametrize(
    ("world", "yaw_deg", "is_configured"),
    [
        *(("dead_end", 90.0, True), ("dead_end", -90.0, False), ("dead_end", 60.0, True)),
        *(("curved", 90.0, False), ("curved", -90.0, True), ("curved", 60.0, False)),
        *slow(
            ("loop", -90.0, True), ("cluttered", 60.0, False), ("corridor", 90.0, False), ("corridor", -90.0, True),
            ("doorway", 60.0, False),
        ),
    ],
)  # fmt: skip
def test_a_lidar_turned_on_the_car_or_in_the_settings_stops_it_for_good_before_a_contact(world, yaw_deg, is_configured):
    """The bare corridor tells it last: there the car steers in a circle, and walls of one direction are all it sees."""
    settings = load_settings(None, ["wall_follow.speed_mps=1.0"])
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    yaw_rad = math.radians(yaw_deg)
    lidar = LidarSettings() if is_configured else LidarSettings().model_copy(update={"mount_yaw_rad": yaw_rad})
    case = Case(load_world(world), duration_s=8.0, seed=5, lidar=lidar, lidar_yaw_rad=yaw_rad if is_configured else 0.0)
    done = drive(case, laws, laws)
    assert done.contact is None
    assert done.reasons[-1] in {TURNED, HELD_OR_TURNED}
    assert done.distance_m < (0.95 if world in {"corridor", "curved", "doorway"} else 0.5)


@pytest.mark.parametrize(
    ("world", "speed_mps", "noise_m", "seed"), [("straight", 3.0, 0.01, 118435), ("doorway", 4.0, 0.02, 240712)]
)
def test_wheels_that_lock_on_a_slippery_floor_are_no_doubt(world, speed_mps, noise_m, seed):
    settings = load_settings(None, [f"wall_follow.speed_mps={speed_mps}", "car.max_speed_mps=4.0"])
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    case = Case(
        load_world(world, seed=seed), duration_s=6.0, seed=seed, lidar=LidarSettings(noise_std_m=noise_m),
        vehicle=VehicleSettings(grip_mu=0.5), car=settings.car,
    )  # fmt: skip
    done = drive(case, laws, laws)
    assert not {BACKWARDS, WRONG_SCALE, TURNED, HELD_OR_TURNED} & set(done.reasons)
    assert done.contact is None
