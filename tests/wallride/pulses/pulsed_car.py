"""A simulated car by servo pulses that is calibrated in virtual time: its ESC differs from its settings as planted."""

from dataclasses import replace

import numpy as np

from tests.runtime.calibration.planted import LAB, MOUNT, ROUGH
from wallride.clients.calibration import STEPS
from wallride.clients.calibration.current_values import PULSE_NAMES
from wallride.clients.calibration.deadman import AlwaysHeld
from wallride.clients.calibration.pulse_steps import pulse_steps
from wallride.clients.calibration.steps import CalibrationProgress
from wallride.clients.calibration.ways import CalibrationError
from wallride.drivers.api import Scan
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.vesc.settings import VescSettings
from wallride.pulses.devices import made_us
from wallride.pulses.link import PulseLink
from wallride.runtime.parameters.catalogue import values
from wallride.runtime.settings.tree import load_settings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.devices.esc import EmulatedEsc, EscModel
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.world.beams import LidarSettings, scan

SCAN_S, ROLLS_OUT_S = 0.025, 8.0
TRUE = EscModel(
    neutral_us=1530.0, dead_us=45.0, us_per_mps=40.0, brake_a=30.0, brake_reach_us=330.0, center_us=1470.0,
    us_per_rad=1000.0, shortest_us=1230.0, longest_us=1760.0,
)  # fmt: skip
"""Planted: neutral 30 us off, a quarter faster, left is right, the linkage's ends at -0.24 and 0.29 rad."""
RIGHT = replace(TRUE, neutral_us=1500.0)


class VirtualBench:
    """Implements OpenBench: a car in a room, whose clock goes on while a scan is waited for.

    written: every throttle pulse. lost_after: number of scans after which the lidar is lost. before_scan: called with
    this bench before each scan.
    """

    def __init__(
        self, model: EscModel = TRUE, world=LAB, seed: int = 0, vehicle: VehicleSettings | None = None
    ) -> None:
        self.esc = EmulatedEsc(model)
        self.world, self.now_s = world, 0.0
        self.vehicle = Vehicle(vehicle or VehicleSettings(max_steering_rad=0.5), world.start)
        self.plant = Plant(self.vehicle, self.esc, VescSettings(), 0.0)
        self.lidar = LidarSettings(**{**ROUGH, **MOUNT})
        self.written: list[float] = []
        self.lost_after: int | None = None
        self.before_scan = lambda _bench: None
        self.is_open = False
        self._rng = np.random.default_rng(seed)
        self._scans = 0

    def open(self, steering_us: float, neutral_us: float) -> None:
        self.is_open = True
        self.write(steering_us, neutral_us, neutral_us)

    def write(self, steering_us: float, throttle_us: float, neutral_us: float) -> tuple[float, float]:
        steering_us, throttle_us = (made_us(Pca9685Settings(), us) for us in (steering_us, throttle_us))
        self.written.append(throttle_us)
        self.esc.pulse(steering_us, throttle_us, self.now_s)
        return steering_us, throttle_us

    def next_scan(self) -> Scan:
        self.before_scan(self)
        self._scans += 1
        if self.lost_after is not None and self._scans > self.lost_after:
            raise CalibrationError("no scan for 0.5 s: the car stops")
        self.now_s += SCAN_S
        self.plant.advance(self.now_s)
        sent_mm = scan(self.world, self.vehicle.pose, self.vehicle.twist, self.now_s, self._rng, self.lidar)
        assert not self.world.collides(self.vehicle.pose)
        return as_scan(sent_mm, self.lidar, self.now_s, 0)

    def close(self, stop_us: float, neutral_us: float) -> None:
        steering_us = 1500.0
        for _ in range(40):
            self.write(steering_us, stop_us, neutral_us)
            self.now_s += SCAN_S
            self.plant.advance(self.now_s)
        self.write(steering_us, neutral_us, neutral_us)
        self.now_s += ROLLS_OUT_S
        self.plant.advance(self.now_s)
        self.is_open = False


def in_effect(path):
    known = values(load_settings(path))
    return {name: float(str(known[name])) for name in PULSE_NAMES}


def linked(bench, path, so_far, deadman=None):
    return PulseLink(bench, deadman or AlwaysHeld(), load_settings(path), so_far.now)


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
