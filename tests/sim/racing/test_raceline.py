"""The race line: on courses whose best line is known, on generated tracks, and where there is none."""

from functools import cache

import numpy as np
import pytest

from wallride.sim.racing.free_space import FreeSpace
from wallride.sim.racing.raceline import NoLineError, _with_speed, geometry, race_line
from wallride.sim.racing.ring import even, ring_of
from wallride.sim.racing.speed_profile import Grip, lap_s, speeds_mps
from wallride.sim.world.generated_tracks import generated_track
from wallride.sim.world.segments import chain, circle_outline
from wallride.sim.world.worlds import load_world

RADIUS_M, KEEP_M = 0.933, 0.45
NEARER_M = 0.03
GRIP = Grip()


def annulus(inner_m, outer_m):
    return np.vstack([circle_outline(0.0, 0.0, radius_m, corners=400) for radius_m in (inner_m, outer_m)])


def on_circle(radius_m, count=400):
    angle_rad = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return radius_m * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


@cache
def round_the_pillar():
    return race_line(even(on_circle(3.0)), FreeSpace(annulus(2.0, 5.0)), GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)


def test_round_a_pillar_the_line_is_the_circle_with_the_fastest_lap():
    """A lap at the limit of grip takes 2 pi sqrt(R / a): the tightest circle that keeps its distance."""
    line = round_the_pillar()
    radius_m = 2.0 + KEEP_M
    assert np.hypot(line.x_m, line.y_m) == pytest.approx(radius_m, abs=NEARER_M)
    assert line.curvature_radpm == pytest.approx(1.0 / radius_m, abs=0.02)
    assert line.speed_mps == pytest.approx(np.sqrt(GRIP.lateral_mps2 * radius_m), rel=0.02)
    assert line.lap_s == pytest.approx(2 * np.pi * np.sqrt(radius_m / GRIP.lateral_mps2), rel=0.02)


def test_through_four_corners_the_line_swings_from_outside_to_inside_to_outside():
    """A square ring of corridors 2 m wide: the bend is wider than any circle about a corner of the inner wall."""
    square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    walls = np.vstack([chain([(size * x, size * y) for x, y in square], closed=True) for size in (4.0, 6.0)])
    middle_m = 5.0 * np.array(square)
    line = race_line(even(middle_m), FreeSpace(walls), GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)
    apart_m = np.hypot(np.abs(line.x_m) - 4.0, np.abs(line.y_m) - 4.0)
    assert apart_m.min() == pytest.approx(KEEP_M, abs=NEARER_M), "the apex"
    outside_m = 6.0 - np.maximum(np.abs(line.x_m), np.abs(line.y_m))
    assert outside_m.min() == pytest.approx(KEEP_M, abs=NEARER_M), "the way out of the bend"
    assert 1.0 / np.abs(line.curvature_radpm).max() > 2.0


def test_the_other_way_round_turns_right_at_the_same_speed():
    space = FreeSpace(annulus(2.0, 5.0))
    back = race_line(even(on_circle(3.0))[::-1], space, GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)
    assert (back.curvature_radpm < 0.0).all()
    assert back.lap_s == pytest.approx(round_the_pillar().lap_s, rel=0.01)


def test_an_avoided_place_is_kept_away_from():
    space = FreeSpace(annulus(2.0, 5.0), [(4.5, 0.0, 0.3)])
    line = race_line(even(on_circle(3.0)), space, GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)
    assert np.hypot(line.x_m - 4.5, line.y_m).min() >= 0.3 + KEEP_M - NEARER_M


@pytest.mark.parametrize("seed", [5001, 5002, 7001, 7002])
def test_generated_tracks_have_a_line_that_the_car_can_turn(seed):
    world = load_world(f"track:seed={seed}") if seed < 7000 else generated_track(seed)
    middle_m, space = ring_of(world), FreeSpace(world.outline_m)
    line = race_line(middle_m, space, GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)
    assert line.away_m.min() >= KEEP_M - NEARER_M
    assert np.abs(line.curvature_radpm).max() <= 1.0 / RADIUS_M
    assert line.lap_s < 0.95 * _with_speed(middle_m, space, GRIP).lap_s, "no faster than the middle of the track"


def test_a_point_that_is_too_near_moves_out_and_does_not_cross_a_wall():
    walls = np.vstack([chain([(-5.0, 0.0), (5.0, 0.0)]), chain([(-5.0, 2.0), (5.0, 2.0)])])
    low_m, high_m = FreeSpace(walls).beside_m(np.array([[0.0, 0.1], [0.0, 1.0]]), np.array([[0.0, 1.0]] * 2), KEEP_M)
    assert low_m == pytest.approx([0.35, -0.55], abs=0.03)
    assert high_m == pytest.approx([1.45, 0.55], abs=0.31)
    assert high_m[0] <= 1.45 + 0.03


def test_where_the_course_is_narrower_than_asked_the_line_keeps_to_its_middle():
    line = race_line(even(on_circle(3.4)), FreeSpace(annulus(3.0, 3.6)), GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)
    assert np.hypot(line.x_m, line.y_m) == pytest.approx(3.3, abs=NEARER_M)


def test_a_turn_tighter_than_the_cars_is_refused_with_its_place():
    with pytest.raises(NoLineError, match=r"radius of 1\.\d+ m, and the car needs 2\.00 m"):
        race_line(even(on_circle(1.2)), FreeSpace(annulus(0.6, 1.9)), GRIP, keep_m=KEEP_M, radius_m=2.0)


def test_a_course_that_crosses_itself_is_refused():
    angle_rad = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
    eight = np.column_stack([6.0 * np.sin(angle_rad), 3.0 * np.sin(2 * angle_rad)])
    far = np.asarray(chain([(-20.0, -20.0), (20.0, -20.0)]))
    narrow = FreeSpace(np.vstack([far, *(circle_outline(x, 0.0, 0.4) for x in (-3.0, 3.0))]))
    with pytest.raises(NoLineError, match="crosses itself"):
        race_line(even(eight), narrow, GRIP, keep_m=KEEP_M, radius_m=RADIUS_M)


def test_braking_and_driving_stay_within_the_friction_ellipse():
    line_m = np.vstack([on_circle(2.0)[:200], on_circle(2.0)[200:] - [0.0, 12.0]])
    _, _, curvature = geometry(even(line_m))
    steps_m = np.full(len(curvature), 0.2)
    grip = Grip(speed_mps=20.0)
    speed = speeds_mps(curvature, steps_m, grip)
    acceleration = (np.roll(speed, -1) ** 2 - speed**2) / (2 * steps_m)
    lateral = np.maximum(speed, np.roll(speed, -1)) ** 2 * np.minimum(np.abs(curvature), np.roll(np.abs(curvature), -1))
    assert acceleration.max() <= grip.drive_mps2 + 1e-9
    assert acceleration.min() >= -grip.brake_mps2 - 1e-9
    assert (speed**2 * np.abs(curvature)).max() <= grip.lateral_mps2 + 1e-9
    used = (lateral / grip.lateral_mps2) ** 2 + (np.minimum(acceleration, 0.0) / grip.brake_mps2) ** 2
    assert used.max() <= 1.1
    assert lap_s(np.full(10, 2.0), np.full(10, 1.0)) == pytest.approx(5.0)


@pytest.mark.parametrize(("mu", "brake_share", "most_mps2"), [(0.8, 0.45, 4.0), (0.5, 0.45, 2.7), (0.5, 0.9, 4.0)])
def test_driving_on_leaves_grip_to_steer_with(mu, brake_share, most_mps2):
    curvature, steps_m = np.where(np.arange(200) < 40, 1.0, 1e-3), np.full(200, 0.1)
    speed = speeds_mps(curvature, steps_m, Grip(mu=mu, brake_share=brake_share, speed_mps=20.0))
    acceleration = (np.roll(speed, -1) ** 2 - speed**2) / (2 * steps_m)
    assert acceleration.max() == pytest.approx(most_mps2, abs=0.05)


def test_a_slower_floor_makes_a_slower_lap():
    curvature, steps_m = np.full(50, 0.4), np.full(50, 0.3)
    laps_s = [lap_s(speeds_mps(curvature, steps_m, Grip(mu=mu)), steps_m) for mu in (0.4, 0.8)]
    assert laps_s[0] == pytest.approx(np.sqrt(2) * laps_s[1], rel=1e-6)
