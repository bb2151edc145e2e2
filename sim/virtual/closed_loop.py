"""One drive, faster than real time: world, car, lidar and the control code of the car, without devices.

Time goes in steps of 2.5 ms. Every revolution of the lidar yields one scan; follower, guard, `arbitrate` and the
`Limiter` process it as the tasks of the runtime would, and their command is on the motor's wire `latency_s` later.
Between the scans of a slow lidar the commands are judged again, as the mux does in silence: the scan grows older.
Nothing reads a clock: the same case gives the same run, bit by bit.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.arbitration.command import (
    NO_LIMIT_MPS,
    Decision,
    DriveCommand,
    QueueEntry,
    Source,
    SpeedLimit,
    Verdict,
    arbitrate,
)
from wallride.runtime.control.guidance import Follower, Guard
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.settings.tree import MuxSettings
from wallride.runtime.tasks.mux import SILENT_AFTER_PERIODS
from wallride.sim.car.vehicle import BrakeDemand, CoastDemand, DelayLine, Demand, SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.car.wiring import WiringConversion
from wallride.sim.virtual.turning_sensor import TurningSensor
from wallride.sim.world.beams import LidarSettings, Millimetres, scan
from wallride.sim.world.obstacles import Obstacle, ObstacleWorld
from wallride.sim.world.place import Surroundings, World, wall_distances_m
from wallride.sim.world.pose import CAR, Floats, Pose, Side

STEP_S = 0.0025
RANGE_MIN_M, RANGE_MAX_M = 0.02, 30.0
"""Limits that a UST-10LX reports; values outside are no distances. A sensor of less range reports its own."""
ROUGH_BEAMS = LidarSettings(noise_std_m=0.02, outlier_share=0.02)
"""Noise under which every law has to prove itself."""
_WIRING = VescSettings()
_VEHICLE = VehicleSettings()
_CAR = CarSettings()
_ORDER = (Source.ESTOP, Source.SAFETY, Source.TELEOP, Source.PERMIT, Source.NAVIGATION)
"""Priorities of the lab, with `safety.binds_teleop`: a human is judged as a navigator is."""
FULL_BRAKE_MPS2 = _WIRING.brake_current_a * _VEHICLE.brake_mps2_per_a + _VEHICLE.drag_mps2
"""Deceleration of the driver's full brake current and the drag on a floor with enough grip: 8.9 m/s2."""
_POLL_S, _TICK_S = 1.0 / _WIRING.poll_hz, 1.0 / MuxSettings().tick_hz
STANDING_BELOW_MPS = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Conditions of a run; every default is that of the tests' car.

    start: pose of the rear axle, None for the world's own. start_speed_mps: the car rolls already.
    distance_m, duration_s, standing_s: the run ends after this way, this time, or this standstill after
        having moved or having tried to for 1 s. It always ends at a contact.
    latency_s: from a scan's last byte to the motor's wire; the vehicle's own delays come on top.
    brake_limit_mps2: the deceleration of a full brake; above the grip the wheels lock.
    truth: the world whose walls count as "the wall" (a wall without its doors), None for the world itself.
    surroundings: surfaces that are seen and hit instead of world and obstacles (glass), None for those.
    cover: change of the lidar's integers at a time [s], e.g. a hand before it; None: no change.
    driver: source of the follower's commands: the navigator, or a human bound by safety.
    wiring: difference between the car's gains and those in its settings, None for none. lidar_yaw_rad: as configured.
    turning: word of a lidar of a full circle (`sim/devices/lidar_kinds.py`) in place of `lidar`'s beams, whose bytes go
        through its driver's code; noise, range and mounting are those of `lidar`.
    """

    world: World
    start: Pose | None = None
    start_speed_mps: float = 0.0
    desired_m: float = 1.0
    side: Side | None = None
    distance_m: float = math.inf
    duration_s: float = 60.0
    standing_s: float = math.inf
    vehicle: VehicleSettings = _VEHICLE
    lidar: LidarSettings = ROUGH_BEAMS
    car: CarSettings = _CAR
    obstacles: tuple[Obstacle, ...] = ()
    seed: int = 0
    latency_s: float = 0.02
    brake_limit_mps2: float = FULL_BRAKE_MPS2
    truth: World | None = None
    surroundings: Surroundings | None = None
    cover: Callable[[Millimetres, float], Millimetres] | None = None
    driver: Source = Source.NAVIGATION
    wiring: WiringConversion | None = None
    lidar_yaw_rad: float = 0.0
    turning: str = ""


@dataclass(slots=True)
class SimulatedStop:
    """A commanded stop of the car. until_s: NaN when it lasted to the end of the run."""

    from_s: float
    reason: str
    winner: Source | None
    measure: float
    speed_mps: float
    until_s: float = math.nan


@dataclass(frozen=True, slots=True)
class FirstContact:
    """The first contact, and the true speed at that moment."""

    time_s: float
    speed_mps: float
    pose: Pose


@dataclass(slots=True, eq=False)
class SimulatedRun:
    """Record of a run. Arrays have one row per scan, taken at its last beam.

    time_s: shape (n,). pose: (n, 3) x [m], y [m], yaw [rad] of the rear axle. speed_mps: (n, 2), the car's and what
    its wheels report. wish: (n, 2) and command: (n, 2), speed [m/s] and steering [rad] of the follower and of what went
    to the wire `latency_s` later; a stop is 0 m/s. capped: (n,) whether safety lowered the wish. wall_m: (n,) distance
    to the followed wall, inf without one. clearance_m: (n,), 0 in contact. appeared: (n,) how many obstacles
    there were for the scan to see. distance_m: way driven. reasons: the decisions' reasons, one per scan. law_fault: of
    a law of the user's, "" without one.
    """

    case: Case
    time_s: Floats
    pose: Floats
    speed_mps: Floats
    wish: Floats
    command: Floats
    capped: Floats
    wall_m: Floats
    clearance_m: Floats
    appeared: Floats
    distance_m: float
    stops: list[SimulatedStop]
    contact: FirstContact | None
    reasons: list[str]
    law_fault: str = ""

    @property
    def error_m(self) -> Floats:
        """Return the distance to the wall less the wanted one, shape (n,); inf where there is no wall."""
        return self.wall_m - self.case.desired_m


_CONSENT = Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "no guard")


def drive(
    case: Case, follower: Follower, guard: Guard | None, meet: Callable[[Vehicle], None] | None = None
) -> SimulatedRun:
    """Drive a case to its end. guard None: without safety. meet: told the vehicle before, e.g. to know its pose."""
    rig = _Rig(case, follower, guard)
    (meet or (lambda _: None))(rig.vehicle)
    return rig.run()


def drive_together(
    drives: Sequence[tuple[Case, Follower, Guard]],
    seen: Callable[[Sequence[Vehicle], int], Surroundings],
    top_mps: float,
) -> list[SimulatedRun]:
    """Drive several cars at once, step by step; each ends by its own case and then stands where it is.

    seen: surroundings of one car, by its place among all vehicles. top_mps: the fastest that any of them becomes.
    """
    rigs = [_Rig(*parts) for parts in drives]
    vehicles = [rig.vehicle for rig in rigs]
    for k, rig in enumerate(rigs):
        rig.meet(seen(vehicles, k), top_mps)
    under_way = [rig.steps() for rig in rigs]
    while under_way:
        under_way = [steps for steps in under_way if next(steps, None) is not None]
    return [rig.finish() for rig in rigs]


def as_scan(reported_mm: Millimetres, lidar: LidarSettings, time_s: float, sequence: int, yaw_rad: float = 0.0) -> Scan:
    """Return the scan that the driver would make of the sensor's integers. yaw_rad: of the lidar as configured."""
    range_max_m = min(lidar.range_max_m, RANGE_MAX_M)
    usable = (reported_mm >= RANGE_MIN_M * 1000) & (reported_mm <= range_max_m * 1000)
    ranges_m = np.where(usable, reported_mm.astype(np.float32) / np.float32(1000), np.float32(np.nan))
    ranges_m.setflags(write=False)
    first_rad, step_rad = math.radians(lidar.first_deg) + yaw_rad, math.radians(lidar.last_deg - lidar.first_deg)
    step_rad /= lidar.beams - 1
    return Scan(time_s, time_s, first_rad, step_rad, RANGE_MIN_M, range_max_m, ranges_m, sequence, lidar.ray_s)


@dataclass(slots=True)
class _Log:
    """Rows under construction."""

    rows: list[tuple[float, ...]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    stops: list[SimulatedStop] = field(default_factory=list)
    stopped: SimulatedStop | None = None

    def decision(self, time_s: float, speed_mps: float, decision: Decision, *, stop: bool) -> None:
        """Open or close a stop."""
        self.reasons.append(decision.reason)
        if stop and self.stopped is None:
            self.stopped = SimulatedStop(time_s, decision.reason, decision.winner, decision.measure, speed_mps)
            self.stops.append(self.stopped)
        elif not stop and self.stopped is not None:
            self.stopped.until_s = time_s
            self.stopped = None


class _Rig:
    """Assembly of car, world and laws during a run."""

    def __init__(self, case: Case, follower: Follower, guard: Guard | None) -> None:
        self._case = case
        self._follower, self._guard = follower, guard
        self.vehicle = self._vehicle = Vehicle(case.vehicle)
        self._vehicle.place(case.start or case.world.start, speed_mps=case.start_speed_mps)
        self._scene = ObstacleWorld(case.world, case.obstacles)
        self._seen: Surroundings = case.surroundings or self._scene
        self._walkers_mps = max(
            (math.hypot(o.motion.x_mps, o.motion.y_mps) for o in case.obstacles if o.motion), default=0.0
        )
        self._rng = np.random.default_rng(case.seed)
        self._limiter = Limiter(case.car)
        self._limiter.limit(case.start_speed_mps, 0.0, dt_s=1e3)  # a rolling car was commanded to
        rolling: Demand = SpeedDemand(case.start_speed_mps) if case.start_speed_mps else CoastDemand()
        self._wire: DelayLine[tuple[Demand, float]] = DelayLine(case.latency_s, (rolling, 0.0))
        self._motor: MotorState | None = None
        self._turning = (
            TurningSensor(case.turning, case.lidar, case.car, lambda: self._motor, self._rng) if case.turning else None
        )
        self._now_s = self._answered_s = self._decided_s = 0.0
        judge = getattr(guard, "guard", guard)  # a stack of laws has it in it
        if self._turning is not None and isinstance(judge, SweptGuard):
            judge.clock = lambda: self._now_s
        self._words: list[QueueEntry] = []
        self._polled_s = -math.inf
        self._free_m = 0.0  # free way of the car before a contact is possible
        self._log = _Log()
        self._distance_m = 0.0
        self._moved_s = 0.0
        self._contact: FirstContact | None = None

    def run(self) -> SimulatedRun:
        for _ in self.steps():
            pass
        return self.finish()

    def meet(self, seen: Surroundings, top_mps: float) -> None:
        """See other surroundings, of which things may come nearer at this speed."""
        self._seen, self._walkers_mps = seen, top_mps

    def steps(self) -> Iterator[int]:
        """Advance by STEP_S each time, until the drive ends."""
        case, vehicle = self._case, self._vehicle
        period_s = 1.0 / case.lidar.rate_hz
        step, scans = 0, 0
        last = round(case.duration_s / STEP_S)
        while step <= last and self._contact is None and self._distance_m < case.distance_m:
            now_s = self._now_s = step * STEP_S
            self._poll(now_s)
            if self._turning is not None:
                self._scene.update(now_s, vehicle.pose, vehicle.speed_mps)
                self._free_m = self._seen.clearance(vehicle.pose)
                for sweep in self._turning.measure(now_s, self._seen, vehicle.pose):
                    self._decide(now_s, sweep)
                self._tick(now_s)
            elif now_s >= scans * period_s - STEP_S / 2:
                self._scene.update(now_s, vehicle.pose, vehicle.speed_mps)
                self._free_m = self._seen.clearance(vehicle.pose)
                self._answer(now_s, scans)
                scans += 1
            if now_s - self._moved_s > max(case.standing_s, 1.0):
                break
            self._advance(now_s)
            step += 1
            yield step

    def _poll(self, now_s: float) -> None:
        """Poll the motor as often as its driver does; speed and way in the VESC's own whole numbers."""
        if now_s - self._polled_s < _POLL_S - STEP_S / 2:
            return
        self._polled_s = now_s
        vehicle, gain = self._vehicle, _WIRING.speed_to_erpm_gain
        steps_m = 10.0 / gain
        wiring, steering_rad = self._case.wiring, self._wire.at(now_s)[1]
        share = 1.0 if wiring is None else wiring.speed_share
        told_rad = steering_rad if wiring is None else wiring.allowed_rad(steering_rad)
        self._motor = MotorState(
            now_s, round(vehicle.wheel_speed_mps / share * gain) / gain,
            math.floor(vehicle.wheel_travel_m / share / steps_m) * steps_m, told_rad, 11.1,
            vehicle.motor_current_a, 0.0, 30.0,
        )  # fmt: skip

    def _answer(self, now_s: float, sequence: int) -> None:
        """Take one scan with the beams of `lidar`, and decide."""
        case, vehicle = self._case, self._vehicle
        reported_mm = scan(self._seen, vehicle.pose, vehicle.twist, now_s, self._rng, case.lidar)
        if case.cover is not None:
            reported_mm = case.cover(reported_mm, now_s)
        self._decide(now_s, as_scan(reported_mm, case.lidar, now_s, sequence, case.lidar_yaw_rad))

    def _decide(self, now_s: float, sweep: Scan) -> None:
        """Process one scan through all stages up to the wire."""
        case, vehicle, pose = self._case, self._vehicle, self._vehicle.pose
        assessment = self._guard.look(sweep, self._motor) if self._guard is not None else _CONSENT
        guidance = self._follower.follow(sweep, self._motor)
        wish = guidance.drive or Drive(0.0, 0.0)
        self._words = [
            SpeedLimit(Source.SAFETY, assessment, now_s),
            DriveCommand(
                case.driver, wish, None if case.driver is Source.TELEOP else now_s, guidance.reason, guidance.stuck,
                guidance.promise,
            ),
        ]  # fmt: skip
        period_s = 1.0 / case.lidar.rate_hz if self._turning is None else now_s - self._decided_s
        decision, told, stop = self._arbitrate(now_s, period_s)
        self._answered_s = now_s
        self._log.decision(now_s, vehicle.speed_mps, decision, stop=stop)
        self._log.rows.append(
            (
                now_s, pose.x_m, pose.y_m, pose.yaw_rad, vehicle.speed_mps, vehicle.wheel_speed_mps, wish.speed_mps,
                wish.steering_rad, 0.0 if stop else told.speed_mps, told.steering_rad,
                decision.winner is Source.SAFETY, self._free_m, self._scene.appeared,
            )
        )  # fmt: skip

    def _tick(self, now_s: float) -> None:
        """Judge the commands in force again in the silence between two scans, at the mux's rate (`SilenceTick`)."""
        since_s = now_s - self._decided_s
        silent = now_s - self._answered_s >= SILENT_AFTER_PERIODS * _TICK_S - STEP_S / 2
        if self._words and silent and since_s >= _TICK_S - STEP_S / 2:
            self._arbitrate(now_s, since_s)

    def _arbitrate(self, now_s: float, since_s: float) -> tuple[Decision, Drive, bool]:
        """Decide on the commands in force; return the decision, the drive that is put on the wire, and if it brakes."""
        decision, memories = arbitrate(self._words, frozenset({Source.SAFETY}), _ORDER)
        for judge, memory in memories:
            judge.commit(memory)
        told = self._limiter.limit(decision.speed_mps, decision.steering_rad, since_s, decision.brake_mps2)
        demand = self._demand(told)
        self._wire.put(now_s, (demand, told.steering_rad))
        self._decided_s = now_s
        return decision, told, isinstance(demand, BrakeDemand)

    def _demand(self, told: Drive) -> Demand:
        """Return the driver's demand for a command: too slow, or against the motion, is a brake."""
        share = 1.0 if self._case.wiring is None else self._case.wiring.speed_share
        speed_mps, wheels_mps = told.speed_mps, self._vehicle.wheel_speed_mps
        turns_back = speed_mps * wheels_mps < 0 and abs(wheels_mps) > STANDING_BELOW_MPS
        if abs(speed_mps) >= _WIRING.min_speed_mps and not turns_back:
            return SpeedDemand(speed_mps * share)
        settings = self._case.vehicle
        by_motor_mps2 = max(0.0, min(told.brake_mps2, self._case.brake_limit_mps2) - settings.drag_mps2)
        return BrakeDemand(by_motor_mps2 / settings.brake_mps2_per_a)

    def _advance(self, now_s: float) -> None:
        """Advance the car by one step, and check for contact when one is possible."""
        vehicle = self._vehicle
        demand, steering_rad = self._wire.at(now_s)
        if self._case.wiring is not None:
            steering_rad = self._case.wiring.steering_rad(steering_rad)
        vehicle.step(STEP_S, demand, steering_rad)
        twist = vehicle.twist
        moved_m = math.hypot(twist.speed_mps, twist.lateral_mps) * STEP_S
        self._distance_m += moved_m
        if moved_m > STANDING_BELOW_MPS * STEP_S:
            self._moved_s = now_s
        self._free_m -= moved_m + (abs(twist.yaw_rate_radps) * CAR.reach_m + self._walkers_mps) * STEP_S
        if self._free_m > 0.0:
            return
        if self._walkers_mps:
            self._scene.update(now_s + STEP_S, vehicle.pose, vehicle.speed_mps)
        self._free_m = self._seen.clearance(vehicle.pose)
        if self._free_m <= 0.0:
            self._contact = FirstContact(now_s + STEP_S, abs(twist.speed_mps), vehicle.pose)

    def finish(self) -> SimulatedRun:
        """Return the record."""
        table = np.array(self._log.rows)
        poses = table[:, 1:4]
        truth = self._case.truth or self._case.world
        return SimulatedRun(
            self._case, table[:, 0], poses, table[:, 4:6], table[:, 6:8], table[:, 8:10], table[:, 10],
            wall_distances_m(truth, poses, self._case.side or self._case.world.side), table[:, 11], table[:, 12],
            self._distance_m, self._log.stops, self._contact, self._log.reasons,
        )  # fmt: skip
