"""A car by servo pulses in virtual time: planted errors become the right settings; nonsense is refused, and the car
stands in neutral whatever ends a step."""

from dataclasses import replace

import numpy as np
import pytest

from tests.wallride.pulses.pulsed_car import TRUE, VirtualBench, in_effect, linked
from wallride.clients.calibration import settings_file
from wallride.clients.calibration.command import table
from wallride.clients.calibration.link import LetGoError
from wallride.clients.calibration.pulse_steps import pulse_steps
from wallride.clients.calibration.steps import STEPS, CalibrationProgress
from wallride.clients.calibration.ways import CalibrationError
from wallride.runtime.calibration import proposals
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.vesc import MotorDemand
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, box

RIGHT = replace(TRUE, neutral_us=1500.0)


@pytest.fixture
def car_toml(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text('[car]\nwheelbase_m = 0.25\n[motor]\ndriver = "pca9685"\n')
    return path


def calibrated(bench, path, steps=STEPS, deadman=None, **now):
    so_far = CalibrationProgress({**in_effect(path), **now}, ruler=bool(now))
    measured = []
    for step in pulse_steps(frozenset(steps)):
        measured += driven(step, bench, path, so_far, deadman)
    return measured, so_far


def driven(step, bench, path, so_far, deadman=None):
    with linked(bench, path, so_far, deadman) as link:
        link.forget()
        return list(step.run(link, so_far))


def stands_in_neutral(bench):
    """Tell whether the last pulse is neutral, to what the board rounds, and the car stands."""
    return abs(bench.written[-1] - bench.esc.model.neutral_us) < 35.0 and abs(bench.vehicle.speed_mps) < 0.01


def test_a_calibration_ends_with_the_settings_of_the_car(car_toml):
    measured, so_far = calibrated(VirtualBench(seed=5), car_toml)
    settings_file.write(car_toml, [one for one in measured if one.changes], "2026-11-27")
    new = in_effect(car_toml)
    assert new[proposals.NEUTRAL] == pytest.approx(1530, abs=3)
    assert (new[proposals.FORWARD], new[proposals.REVERSE]) == pytest.approx((1575, 1485), abs=4)
    assert new[proposals.THROTTLE] == pytest.approx(40.0, rel=0.06)
    assert new[proposals.PULSE_CENTER] == pytest.approx(1470, abs=3)
    assert new[proposals.PULSE_GAIN] == 1150.0, "left was right; the gain is the ruler's"
    assert new[proposals.WHEELBASE] == pytest.approx(0.33 * 1000 / 1150, rel=0.02)
    assert new["motor.steering_min_us"] == pytest.approx(1230, abs=6)
    assert new["motor.steering_max_us"] == pytest.approx(1760, abs=6)
    assert new[proposals.LIDAR_X] == pytest.approx(0.29, abs=0.01)
    assert new[proposals.LIDAR_YAW] == pytest.approx(np.radians(2.0), abs=0.005)
    assert new[proposals.GRIP] == pytest.approx(30 * 0.17 / 9.81, abs=0.03), "as hard as its ESC brakes"
    shown = table(measured)
    assert "motor.neutral_us           1500    1530" in shown
    assert "by tape" in shown, "what such a car does not tell is said"
    assert "brakes and does not drive backward" in shown
    assert any(note.startswith("throttle: neutral from 148") for note in so_far.notes)


def test_with_a_ruler_the_gain_of_the_servo_is_measured(car_toml):
    bench = VirtualBench(replace(RIGHT, shortest_us=0.0, longest_us=3000.0), seed=2)
    measured, _ = calibrated(bench, car_toml, ["steering"], **{proposals.WHEELBASE: 0.33})
    found = {one.name: one for one in measured}
    assert found[proposals.PULSE_GAIN].new == pytest.approx(1000, rel=0.02)
    assert not found["motor.steering_min_us"].changes, "the linkage goes as far as it is wanted"
    assert not found["motor.steering_max_us"].changes


def drives_at_neutral(bench):
    bench.esc.model = replace(TRUE, neutral_us=1440.0, dead_us=30.0)
    bench.esc._armed = True


def drives_nothing(bench):
    bench.esc.model = replace(TRUE, dead_us=600.0)


def drives_alike(bench):
    bench.esc.__class__ = type("Limited", (EmulatedEsc,), {"demand": limited})


def limited(esc, now_s):
    demand = EmulatedEsc.demand(esc, now_s)
    return MotorDemand("speed", np.copysign(1600.0, demand.value)) if demand.kind == "speed" else demand


def drives_backward(bench):
    bench.esc.__class__ = type("Swapped", (EmulatedEsc,), {"demand": swapped})


def swapped(esc, now_s):
    demand = EmulatedEsc.demand(esc, now_s)
    return replace(demand, value=-demand.value) if demand.kind == "speed" else demand


def reverses_at_once(bench):
    bench.before_scan = lambda bench: setattr(bench.esc, "_may_reverse", True)


def never_reverses(bench):
    bench.before_scan = lambda bench: setattr(bench.esc, "_may_reverse", False)


def is_boxed(bench):
    bench.world = World("boxed", SegmentGeometry(box(0.9, 0.0, 0.1, 0.4)), Pose(0.0, 0.0, 0.0))


def runs_away(bench):
    bench.esc.model = replace(TRUE, us_per_mps=5.0)


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (drives_at_neutral, r"moves at 1500 us, which is to be its neutral.*motor\.neutral_us"),
        (drives_nothing, r"no pulse from 1400 to 1760 us moved the car.*is the ESC on"),
        (drives_alike, "us drive alike"),
        (drives_backward, "drove backward.*swap two cables"),
        (reverses_at_once, "backward by its brake pulse: set the ESC to forward, brake and reverse"),
        (never_reverses, r"no pulse down to .* us drove the car backward"),
        (is_boxed, "ahead of the lidar.*move the car"),
        (runs_away, "faster than a calibration may"),
    ],
)
def test_nonsense_is_refused_with_what_to_do(plant, words, car_toml):
    bench = VirtualBench(TRUE if plant not in {never_reverses, reverses_at_once} else RIGHT, seed=1)
    plant(bench)
    with pytest.raises(CalibrationError, match=words):
        calibrated(bench, car_toml, ["speed"])
    assert bench.written[-1] == pytest.approx(1500.0, abs=60)
    if plant is not drives_at_neutral:
        assert abs(bench.vehicle.speed_mps) < 0.01


def test_a_brake_pulse_that_drives_backward_is_found_although_a_weak_one_brakes(car_toml):
    bench = VirtualBench(TRUE, seed=3)
    _, so_far = calibrated(bench, car_toml, ["speed", "steering"])

    def reverses_by_a_long_pulse(bench):
        if bench.written[-1] < 1300.0:
            bench.esc._may_reverse = True

    bench.before_scan = reverses_by_a_long_pulse
    braking = pulse_steps(frozenset({"brake"}))[-1]
    with pytest.raises(CalibrationError, match="backward by its brake pulse"):
        driven(braking, bench, car_toml, so_far)
    assert stands_in_neutral(bench)


class ReleasedAfter:
    """A deadman that is let go, or whose holder presses Ctrl-C, after so many looks."""

    def __init__(self, looks, error=None):
        self.looks, self.error = looks, error

    def is_held(self):
        self.looks -= 1
        if self.looks == 0 and self.error is not None:
            raise self.error
        return self.looks > 0


@pytest.mark.parametrize("looks", [90, 250, 330, 420, 500, 900])
@pytest.mark.parametrize("error", [None, KeyboardInterrupt(), SystemExit(129)])
def test_whatever_ends_a_step_the_car_stands_in_neutral(looks, error, car_toml):
    bench = VirtualBench(seed=4)
    with pytest.raises((LetGoError, KeyboardInterrupt, SystemExit)):
        calibrated(bench, car_toml, ["speed"], ReleasedAfter(looks, error))
    assert not bench.is_open
    assert stands_in_neutral(bench)


@pytest.mark.parametrize("scans", [100, 500, 900])
def test_a_lidar_that_is_lost_ends_the_step_in_neutral(scans, car_toml):
    bench = VirtualBench(seed=4)
    bench.lost_after = scans
    with pytest.raises(CalibrationError, match="no scan"):
        calibrated(bench, car_toml, ["speed"])
    assert stands_in_neutral(bench)


def test_a_lifted_car_is_told_so(car_toml):
    bench = VirtualBench(seed=1)
    bench.plant.advance = lambda _to_s: None
    with pytest.raises(CalibrationError, match="the car on the floor"):
        calibrated(bench, car_toml, ["speed"])


def test_steps_that_are_not_wanted_are_not_driven():
    assert [step.title for step in pulse_steps(frozenset({"speed"}))] == ["throttle"]
    assert [step.title for step in pulse_steps(frozenset({"lidar"}))] == ["steering, lidar, own parts"]
    assert [step.title for step in pulse_steps(frozenset({"brake"}))] == ["steering, lidar, own parts", "braking"]
    assert not pulse_steps(frozenset({"delay", "outline"}))
