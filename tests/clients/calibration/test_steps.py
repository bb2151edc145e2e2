"""The steps on a simulated car: every planted error becomes the right setting; what may not be driven is not driven."""

import numpy as np
import pytest

from tests.runtime.calibration import calibrated_car
from tests.runtime.calibration.planted import ERRORS, LAB, YAW_RAD, planted_car
from wallride.clients.calibration import STEPS, settings_file, ways
from wallride.clients.calibration.command import table
from wallride.clients.calibration.current_values import NAMES
from wallride.clients.calibration.steps import CalibrationProgress, drive_tape, driven_steps
from wallride.clients.calibration.ways import CalibrationError
from wallride.runtime.calibration import proposals
from wallride.runtime.parameters.catalogue import values
from wallride.runtime.settings.tree import load_settings
from wallride.sim.world.beams import scan
from wallride.sim.world.place import World
from wallride.sim.world.pose import STANDING, Pose
from wallride.sim.world.segments import SegmentGeometry, box
from wallride.sim.world.worlds import load_world


def in_effect(path):
    known = values(load_settings(path))
    return {name: float(str(known[name])) for name in NAMES}


FILE = "[car]\nwheelbase_m = 0.25\n"


def test_a_calibration_ends_with_the_settings_of_the_car(car_toml):
    so_far, measured = CalibrationProgress(in_effect(car_toml)), []
    car = planted_car(5, own_parts="posts")
    for step in driven_steps(frozenset(STEPS)):
        measured += step.run(car, so_far)
    settings_file.write(car_toml, [one for one in measured if one.changes], "2026-11-23")
    new = in_effect(car_toml)
    assert new[proposals.SPEED_GAIN] == pytest.approx(4614 * 1.15, rel=0.01)
    assert new[proposals.WHEELBASE] == pytest.approx(0.33, rel=0.01)
    assert new[proposals.SERVO_OFFSET] == pytest.approx(0.5604, abs=0.003)
    assert (new[proposals.LIDAR_X], new[proposals.LIDAR_Y]) == pytest.approx((0.29, 0.02), abs=0.01)
    assert new[proposals.LIDAR_YAW] == pytest.approx(YAW_RAD, abs=0.005)
    assert new[proposals.LATENCY] == pytest.approx(0.0725, abs=0.0055)
    assert new[proposals.ACTUATION] == pytest.approx(0.09, abs=0.0055)
    assert any("own parts: " in note and "deg" in note for note in so_far.notes)
    assert any("0.24 rad to the right" in note for note in so_far.notes)
    shown = table(measured)
    assert "0.25" in shown
    assert "before" in shown
    assert {one.name for one in measured} >= {proposals.GRIP, proposals.LATENCY}
    grip = next(one for one in measured if one.name == proposals.GRIP)
    assert float(grip.words.partition(" to ")[0]) < 1.5, "of the grip, no deceleration"


def test_with_a_ruler_the_gain_of_the_servo_is_measured(car_toml):
    so_far = CalibrationProgress({**in_effect(car_toml), proposals.WHEELBASE: 0.33}, ruler=True)
    (step,) = driven_steps(frozenset({"steering"}))
    found = {one.name: one.new for one in step.run(planted_car(2), so_far)}
    assert set(found) == {proposals.SERVO_GAIN, proposals.SERVO_OFFSET}
    assert found[proposals.SERVO_GAIN] == pytest.approx(-1.2135, rel=0.02)
    assert not any("upside down" in note for note in so_far.notes)


def test_a_lidar_that_is_upside_down_is_named_beside_a_steering_the_wrong_way_round(car_toml):
    so_far = CalibrationProgress(in_effect(car_toml))
    (step,) = driven_steps(frozenset({"steering"}))
    car = planted_car(2, errors=ERRORS.model_copy(update={"servo_gain_share": -1.0}))
    found = {one.name: one.new for one in step.run(car, so_far)}
    assert found[proposals.SERVO_GAIN] == 1.2135
    assert any("lidar.mounted_upside_down" in note for note in so_far.notes)


@pytest.mark.parametrize(
    ("yaw_rad", "words"),
    [
        (np.pi, "backward.*swap two motor phases.*the lidar is turned by 180 degrees"),
        (-1.6, r"degrees to the left of ahead: the lidar is turned; set lidar\.yaw_rad = -1\.[56]"),
    ],
)
def test_a_turned_lidar_is_not_taken_for_a_swapped_or_blocked_motor(car_toml, yaw_rad, words):
    car = planted_car(1, mount_yaw_rad=yaw_rad)
    (step,) = driven_steps(frozenset({"speed"}))
    with pytest.raises(CalibrationError, match=words):
        list(step.run(car, CalibrationProgress(in_effect(car_toml))))
    assert car.twin.way_m < 1.0


def before_one_wall():
    return World("wall", SegmentGeometry(box(3.0, 0.0, 0.05, 12.0)), Pose(0.0, 0.0, 0.0))


@pytest.mark.parametrize("world", [LAB, before_one_wall()])
def test_a_motor_that_runs_backward_is_not_driven_far(car_toml, world):
    car = planted_car(1, world)
    car.motor.phases_swapped = True
    (step,) = driven_steps(frozenset({"speed"}))
    with pytest.raises(CalibrationError, match="swap two motor phases"):
        list(step.run(car, CalibrationProgress(in_effect(car_toml))))
    assert car.twin.way_m < 1.0


@pytest.mark.parametrize("seed", range(3))
def test_a_lifted_car_is_told_so_and_not_that_its_motor_is_swapped(car_toml, monkeypatch, seed):
    car = planted_car(seed)

    def from_the_stand(scene, _pose, _twist, now_s, rng, settings):
        return scan(scene, LAB.start, STANDING, now_s, rng, settings)

    monkeypatch.setattr(calibrated_car, "scan", from_the_stand)
    (step,) = driven_steps(frozenset({"speed"}))
    with pytest.raises(CalibrationError, match="lifted"):
        list(step.run(car, CalibrationProgress(in_effect(car_toml))))
    assert car.twin.way_m < 1.0


@pytest.mark.parametrize(("seed", "world"), [(0, "corridor"), (1, "loop")])
def test_where_the_scans_do_not_tell_the_way_the_motor_is_not_blamed(car_toml, seed, world):
    (step,) = driven_steps(frozenset({"speed"}))
    so_far = CalibrationProgress(in_effect(car_toml))
    (speed,) = step.run(planted_car(seed, load_world(world)), so_far)
    assert speed.new is None
    assert "do not tell how far the car went" in speed.words


def test_what_needs_the_first_step_is_left_out_without_it(car_toml):
    first, delays, braking = driven_steps(frozenset(STEPS))
    so_far = CalibrationProgress(in_effect(car_toml))
    assert first.missing(so_far) == ""
    assert "measured nothing" in delays.missing(so_far)
    assert "measured nothing" in braking.missing(so_far)


def test_a_way_without_room_is_not_driven():
    boxed = World("boxed", SegmentGeometry(box(1.5, 0.0, 0.4, 0.4)), Pose(0.0, 0.0, 0.0))
    car = planted_car(0, boxed)
    with pytest.raises(CalibrationError, match="move the car"):
        ways.drive_arcs(car)
    assert car.twin.way_m < 0.01


def test_a_car_that_does_not_move_is_told_so():
    car = planted_car(0)
    car.motor.latch_fault("over voltage")
    with pytest.raises(CalibrationError, match="does not move"):
        ways.drive_arcs(car)


def test_a_way_along_a_tape_is_reported(car_toml):
    so_far = CalibrationProgress(in_effect(car_toml))
    car = planted_car(0, LAB)
    assert not list(drive_tape(car, so_far))
    assert so_far.taped_m == pytest.approx(car.twin.way_m * 1.15, rel=0.02)
