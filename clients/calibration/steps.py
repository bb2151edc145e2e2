"""Steps of a calibration: what each drives, what the operator sees to before, and the settings that it measures."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from wallride.clients.calibration import BRAKE, DELAY, LIDAR, PARTS, SPEED, STEERING, ways
from wallride.clients.calibration.ways import CalibratedCar, CalibrationError
from wallride.runtime.calibration import proposals
from wallride.runtime.calibration.arc_fit import AssumedCar
from wallride.runtime.calibration.measured_car import (
    MeasuredArcs,
    measure_arcs,
    measure_braking,
    measure_delays,
    measure_forward,
)
from wallride.runtime.calibration.near_parts import sectors
from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.calibration.responses import Estimate
from wallride.runtime.calibration.trace import Trace

BY_ARCS = frozenset({SPEED, STEERING, LIDAR, PARTS})
OF_STEP: Mapping[str, frozenset[str]] = {
    SPEED: frozenset({proposals.SPEED_GAIN}),
    STEERING: frozenset({
        proposals.WHEELBASE, *(name for names in proposals.STEERINGS for name in (names.gain, names.middle)),
    }),
    LIDAR: frozenset({proposals.LIDAR_X, proposals.LIDAR_Y, proposals.LIDAR_YAW}),
}  # fmt: skip
OUTLINE_WORDS = {
    "car.front_m": "from the rear axle to the front end of the car",
    "car.rear_m": "from the rear axle to the rear end",
    "car.half_width_m": "half of the greatest width, wheels included",
}
DEFAULT_DELAY_S = 0.02
SIDEWAYS_RAD = math.radians(75.0)
"""Angle beside ahead, or beside backward, above which scans do not tell forward from backward."""
MIN_FORWARD_SHARE = 0.25
"""Share of the first way that the lidar must see: wheels in the air turn, and the car stays where it is."""


@dataclass(slots=True)
class CalibrationProgress:
    """Values in effect, and what was measured so far. ruler: the wheelbase was measured with a ruler.

    taped_m: way of the drive along a tape, as reported. deceleration_mps2: of the stops.
    """

    now: Mapping[str, float]
    ruler: bool = False
    arcs: MeasuredArcs | None = None
    motor_delay_s: float = DEFAULT_DELAY_S
    taped_m: float | None = None
    deceleration_mps2: Estimate | None = None
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class DrivenStep:
    """One drive. before: what the operator sees to. run: drives and yields what it measured.

    needs_arcs: whether it uses what the first step measured.
    """

    title: str
    before: str
    run: Callable[[CalibratedCar, CalibrationProgress], Iterator[Proposal]]
    needs_arcs: bool = False

    def missing(self, so_far: CalibrationProgress) -> str:
        """Return why it cannot be driven now, "" where it can."""
        if self.needs_arcs and so_far.arcs is None:
            return f"{self.title}: left out, since it needs the first step, which measured nothing"
        return ""


def driven_steps(wanted: frozenset[str]) -> list[DrivenStep]:
    """Return the drives of the wanted steps, in order; the arcs come first, since delays need what they tell."""
    found = []
    if wanted & (BY_ARCS | {DELAY, BRAKE}):
        found.append(DrivenStep("speed, steering, lidar, own parts", room(ways.LONG_M), arcs(wanted)))
    if wanted & {DELAY, BRAKE}:
        found.append(DrivenStep("delays", room(ways.WEAVE_M), _delays(wanted), needs_arcs=True))
    if BRAKE in wanted:
        found.append(
            DrivenStep("braking", f"{room(ways.RUN_M)} It drives {ways.RUN_MPS} m/s.", braking, needs_arcs=True)
        )
    return found


def room(way_m: float) -> str:
    """Return what the operator sees to before ways of this length."""
    return (
        f"Put the car in a room with walls or boxes all around, {way_m + ways.MARGIN_M:.1f} m free ahead of it and"
        " 1 m on both sides. It drives to and fro, and comes back to where it began."
    )


def arcs(wanted: frozenset[str]) -> Callable[[CalibratedCar, CalibrationProgress], Iterator[Proposal]]:
    """Return the drive of the arcs, which yields what the wanted steps measure of them."""

    def run(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
        now = so_far.now
        assumed = AssumedCar(
            now[proposals.WHEELBASE], now[proposals.LIDAR_X], now[proposals.LIDAR_Y], ruler=so_far.ruler
        )
        begin_s = car.now_s
        ways.drive_first(car)
        check_forward(car.seen.trace().between(begin_s, car.now_s), now)
        begin_s = car.now_s
        ways.drive_arcs(car)
        so_far.arcs = measure_arcs(car.seen.trace().between(begin_s, car.now_s), assumed)
        so_far.notes += _parts(so_far.arcs, car) if PARTS in wanted else []
        names = frozenset().union(*(OF_STEP.get(step, frozenset()) for step in wanted))
        found = list(proposals.of_arcs(so_far.arcs.fit, now, ruler=so_far.ruler))
        so_far.notes += _reversed(found) if STEERING in wanted else []
        so_far.notes += _limits(found, now) if STEERING in wanted and proposals.SERVO_GAIN in now else []
        yield from (one for one in found if one.name in names)

    return run


def check_forward(trace: Trace, now: Mapping[str, float], sideways_rad: float = SIDEWAYS_RAD) -> None:
    """CalibrationError where the first way forward of a drive led nowhere, sideways or backward by the scans."""
    found = measure_forward(trace, lidar_place_m(now))
    if found is None:
        return
    way_m, toward_rad = found
    if way_m < MIN_FORWARD_SHARE * ways.FIRST_M:
        raise CalibrationError(
            f"the wheels turned for {ways.FIRST_M} m and the car went {way_m:.2f} m: is it lifted, blocked, or"
            " do the wheels slip? Put it on the floor with its way free"
        )
    if abs(toward_rad) > math.pi - SIDEWAYS_RAD:
        raise CalibrationError(proposals.SWAPPED)
    if abs(toward_rad) > sideways_rad:
        raise CalibrationError(sideways(toward_rad, now[proposals.LIDAR_YAW]))


def sideways(toward_rad: float, yaw_rad: float) -> str:
    """Return what to do where scans see the car drive into this direction. yaw_rad: of the lidar as configured."""
    side = "left" if toward_rad > 0.0 else "right"
    turned_rad = math.remainder(yaw_rad - toward_rad, math.tau)
    return (
        f"by the scans the car drove {abs(math.degrees(toward_rad)):.0f} degrees to the {side} of ahead: the lidar is"
        f" turned; set lidar.yaw_rad = {turned_rad:.2f} and begin again"
    )


def lidar_place_m(now: Mapping[str, float]) -> tuple[float, float]:
    """Return the place of the lidar, ahead of the rear axle and to the left."""
    return now[proposals.LIDAR_X], now[proposals.LIDAR_Y]


def new_values(found: Sequence[Proposal]) -> dict[str, float]:
    """Return what was measured, by the names of the settings."""
    return {one.name: one.new for one in found if one.new is not None}


def _reversed(found: list[Proposal]) -> list[str]:
    """Say that a lidar that is upside down looks like a steering the wrong way round."""
    gains = {names.gain for names in proposals.STEERINGS}
    if not any(one.name in gains and one.new is not None and one.new * one.old < 0.0 for one in found):
        return []
    words = (
        "by the scans left was right. Did the wheels turn to the side that was asked for? Then write none of this: the"
        " lidar is upside down, set lidar.mounted_upside_down and begin again"
    )
    return [words]


def _limits(found: list[Proposal], now: Mapping[str, float]) -> list[str]:
    """Return how far the wheels turn within the servo's limits around the new middle."""
    new = {**now, **new_values(found)}
    ends = proposals.SERVO.ends
    angles_rad = sorted((new[end] - new[proposals.SERVO_OFFSET]) / new[proposals.SERVO_GAIN] for end in ends)
    right_rad, left_rad = -angles_rad[0], angles_rad[1]
    words = f"{right_rad:.2f} rad to the right, {left_rad:.2f} rad to the left"
    return [f"steering within motor.servo_min and servo_max: {words}; widen them where the linkage allows more"]


def _parts(arcs: MeasuredArcs, car: CalibratedCar) -> list[str]:
    found = sectors(arcs.part_m, car.seen.kind)
    if not found:
        return ["own parts: none in the lidar's view"]
    places = ", ".join(f"{first:.0f} to {last:.0f} deg at {range_m:.2f} m" for first, last, range_m in found)
    return [f"own parts: {places}; the car learns them by itself (wallride own-parts show)"]


def _delays(wanted: frozenset[str]) -> Callable[[CalibratedCar, CalibrationProgress], Iterator[Proposal]]:
    def run(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
        if so_far.arcs is None:
            raise CalibrationError("the delays need the arcs before them")
        begin_s = car.now_s
        ways.drive_weaves(car)
        part = car.seen.trace().between(begin_s, car.now_s)
        servo, motor = measure_delays(part, so_far.arcs, so_far.now["car.steering_rate_radps"])
        if not motor.delay_s.why:
            so_far.motor_delay_s = motor.delay_s.value
        if DELAY in wanted:
            so_far.notes += [
                f"delay of the servo: {servo.delay_s.as_text('s')}",
                f"delay of the motor: {motor.delay_s.as_text('s')}",
            ]
            yield from proposals.of_delays(servo, motor, so_far.now, car.seen.period_s)

    return run


def braking(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
    """Drive fast, stop, and yield the grip."""
    if so_far.arcs is None:
        raise CalibrationError("the braking needs the arcs before it")
    begin_s = car.now_s
    ways.drive_stops(car)
    part = car.seen.trace().between(begin_s, car.now_s)
    deceleration = measure_braking(part, so_far.arcs, so_far.motor_delay_s)
    so_far.deceleration_mps2 = deceleration
    so_far.notes.append(f"deceleration of a stop: {deceleration.as_text('m/s2')}")
    yield from proposals.of_braking(deceleration, so_far.now)


def drive_tape(car: CalibratedCar, so_far: CalibrationProgress) -> Iterator[Proposal]:
    """Drive along a tape, and note the way that the car reports."""
    so_far.taped_m = ways.drive_straight(car)
    yield from ()
