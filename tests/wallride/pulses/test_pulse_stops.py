"""Nonsense is refused with what to do, and whatever ends a step, the car by servo pulses stands in neutral."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.calibration.planted import CORRIDOR
from tests.tiers import slow
from tests.wallride.pulses.pulsed_car import RIGHT, TRUE, VirtualBench, calibrated, stands_in_neutral
from wallride.clients.calibration.link import LetGoError
from wallride.clients.calibration.pulse_steps import pulse_steps
from wallride.clients.calibration.ways import CalibrationError
from wallride.sim.devices.esc import EmulatedEsc
from wallride.sim.devices.vesc import MotorDemand
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, box


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


def is_between_bare_walls(bench):
    bench.world = CORRIDOR


def runs_away(bench):
    bench.esc.model = replace(TRUE, us_per_mps=5.0)


def turned(yaw_rad):
    def plant(bench):
        bench.lidar = bench.lidar.model_copy(update={"mount_yaw_rad": yaw_rad})

    return plant


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (turned(1.4), r"by the scans the car drove \d+ degrees to the right of ahead.*set lidar\.yaw_rad = 1\.[345]"),
        (turned(-1.0), r"the car drove \d+ degrees to the left of ahead.*set lidar\.yaw_rad = -(0\.9|1\.[01])"),
        (turned(0.4), r"the car drove \d+ degrees to the right of ahead.*set lidar\.yaw_rad = 0\.(3[89]|4[0-2])"),
        (turned(3.1), "by the scans the car drove backward.*then the lidar is turned by 180 degrees"),
        (drives_at_neutral, r"moves at 1500 us, which is to be its neutral.*motor\.neutral_us"),
        (drives_backward, "drove backward.*swap two cables"),
        (reverses_at_once, "backward by its brake pulse: set the ESC to forward, brake and reverse"),
        (is_boxed, "ahead of the lidar.*move the car"),
        (is_between_bare_walls, "do not tell how far the car went.*boxes"),
        (runs_away, "faster than a calibration may"),
        *slow(
            (drives_nothing, r"no pulse from 1400 to 1760 us moved the car.*is the ESC on.*the car on the floor"),
            (drives_alike, "us drive alike"),
            (never_reverses, r"no pulse down to .* us drove the car backward"),
        ),
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
def test_whatever_ends_a_step_the_car_stands_in_neutral(looks, car_toml):
    bench = VirtualBench(seed=4)
    error = {250: KeyboardInterrupt(), 420: SystemExit(129), 500: KeyboardInterrupt()}.get(looks)
    with pytest.raises((LetGoError, KeyboardInterrupt, SystemExit)):
        calibrated(bench, car_toml, ["speed"], ReleasedAfter(looks, error))
    assert not bench.is_open
    assert stands_in_neutral(bench)


@pytest.mark.parametrize("scans", [100, 500])
def test_a_lidar_that_is_lost_ends_the_step_in_neutral(scans, car_toml):
    bench = VirtualBench(seed=4)
    bench.lost_after = scans
    with pytest.raises(CalibrationError, match="no scan"):
        calibrated(bench, car_toml, ["speed"])
    assert stands_in_neutral(bench)


def test_steps_that_are_not_wanted_are_not_driven():
    assert [step.title for step in pulse_steps(frozenset({"speed"}))] == ["speed by the throttle"]
    assert [step.title for step in pulse_steps(frozenset({"lidar"}))] == ["steering, lidar, own parts"]
    assert [step.title for step in pulse_steps(frozenset({"brake"}))] == ["steering, lidar, own parts", "braking"]
    assert [step.needs_arcs for step in pulse_steps(frozenset({"steering"}))] == [False, True]
    assert not pulse_steps(frozenset({"delay", "outline"}))
