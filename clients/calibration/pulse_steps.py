"""Steps of a calibration of a car by servo pulses, where they differ from those of a car with a tachometer."""

import math
from collections.abc import Callable, Iterator
from typing import cast

from wallride.clients.calibration import BRAKE, SPEED, STEERING, pulse_ways, ways
from wallride.clients.calibration.pulse_ways import PulsedCar
from wallride.clients.calibration.steps import (
    BY_ARCS,
    CalibrationProgress,
    DrivenStep,
    arcs,
    braking,
    check_forward,
    lidar_place_m,
    new_values,
    room,
)
from wallride.clients.calibration.ways import CalibratedCar, CalibrationError
from wallride.runtime.calibration import proposals
from wallride.runtime.calibration.measured_car import measure_locks
from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.calibration.throttle_fit import fit_throttle

NO_DELAY = "delay: it compares commands with the motor's own report, which a car by servo pulses has not; left out"
BEHIND = " Leave 0.5 m behind it, as it rolls out backward, and keep its switch within reach."
TURNED_RAD = 0.15
"""Angle by which a lidar is turned from which on its scans do not tell how far the car drove: by more than 1 %."""
MIN_BRAKE_MPS2 = 1.0
"""Deceleration below which a pulse does not count as a brake: a car that rolls out has up to half of it."""


def pulse_steps(wanted: frozenset[str]) -> list[DrivenStep]:
    """Return the drives of the wanted steps, in order; each later one drives by what those before it measured."""
    found = []
    if SPEED in wanted:
        found.append(DrivenStep("speed by the throttle", room(pulse_ways.WAY_M) + BEHIND, _throttle))
    if wanted & (BY_ARCS - {SPEED} | {BRAKE}):
        found.append(DrivenStep("steering, lidar, own parts", room(ways.LONG_M) + BEHIND, _bends(wanted)))
    if STEERING in wanted:
        found.append(DrivenStep("ends of the steering", room(pulse_ways.LOCK_M) + BEHIND, _ends, needs_arcs=True))
    if BRAKE in wanted:
        found.append(
            DrivenStep("braking", f"{room(ways.RUN_M)}{BEHIND} It drives {ways.RUN_MPS} m/s.", _brake, needs_arcs=True)
        )
    return found


def _throttle(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
    pulsed, now = cast("PulsedCar", car), so_far.now
    begun = {**now, **pulse_ways.find_range(pulsed, now)}
    way = math.copysign(1.0, begun[proposals.FORWARD] - begun[proposals.NEUTRAL])
    begin_s = car.now_s
    speeds = pulse_ways.drive_speeds(pulsed, begun)
    check_forward(car.seen.trace().between(begin_s, car.now_s), now, TURNED_RAD)
    fit = fit_throttle(speeds, way)
    if fit.forward_us.why:
        raise CalibrationError(fit.forward_us.why)
    found = list(proposals.of_throttle(fit, now))
    so_far.now = {**now, **new_values(found)}
    so_far.notes.append(
        f"throttle: neutral from {fit.reverse_us.as_text('us')} to {fit.forward_us.as_text('us')};"
        f" {fit.us_per_mps.as_text('us')} for each m/s"
    )
    yield from found


def _bends(wanted: frozenset[str]) -> Callable[[CalibratedCar, CalibrationProgress], Iterator[Proposal]]:
    def run(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
        found = list(arcs(wanted)(car, so_far))
        so_far.now = {**so_far.now, **new_values(found)}
        yield from found

    return run


def _ends(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
    """Drive with the wheels turned most, by gain and middle as they were just measured."""
    if so_far.arcs is None or so_far.arcs.fit.offset_rad.why:
        raise CalibrationError("the ends need the middle of the steering, which the bends did not tell")
    now, begin_s = so_far.now, car.now_s
    pulse_ways.drive_locks(car, now[proposals.MOST_STEERING])
    trace = car.seen.trace().between(begin_s, car.now_s)
    locks = measure_locks(trace, so_far.arcs, now[proposals.WHEELBASE], lidar_place_m(now))
    for side in (1, -1):
        of_side = [(commanded, driven) for commanded, driven in locks if commanded * side > 0]
        if of_side:
            commanded, driven = (sum(angles) / len(of_side) for angles in zip(*of_side, strict=True))
            yield proposals.of_lock(commanded, driven, now)


def _brake(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
    pulse_us = so_far.now[proposals.BRAKE_PULSE]
    cast("PulsedCar", car).use(so_far.now, gentle=False)
    found = list(braking(car, so_far))
    yield from found
    brakes = so_far.deceleration_mps2
    if brakes is None or brakes.why:
        return
    weak = brakes.value < MIN_BRAKE_MPS2
    words = "it hardly brakes: see the ESC's brake force" if weak else "it brakes and does not drive backward"
    yield Proposal(proposals.BRAKE_PULSE, pulse_us, pulse_us, words)
