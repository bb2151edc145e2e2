"""Scenes of a simulated lidar: a world in which the car drives, and a recording of a real one."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import ProtocolError
from wallride.drivers.hokuyo.replies import SensorParameters
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.devices.own import OwnLidarEmulator
from wallride.sim.devices.scip_encode import UST_10LX, SensorModel
from wallride.sim.devices.turning import Rays, TurningDevice
from wallride.sim.figures.comparison import ComparedSteering, drove, recorded_answers
from wallride.sim.figures.summary import Sample
from wallride.sim.recordings.recording import SCIP_MAX_MM, Recording, RecordingError, to_sensor_mm
from wallride.sim.world.beams import LidarSettings, scan, sector
from wallride.sim.world.lap import LapCounter
from wallride.sim.world.obstacles import Obstacle
from wallride.sim.world.obstacles import ObstacleWorld as Surroundings
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose, Side, Twist

Ranges = npt.NDArray[np.int64]
AFTER_CRASH_S = 0.5
AFTER_LAPS_S = 1.0
"""Time for which the car goes on after its laps: it counts its own, and tells of the last one a little later."""


class WorldScene:
    """World with the car in it; ends shortly after the requested laps, or after a crash.

    back_to: where a car that touched something is put, and the drive goes on; None: a crash ends it.
    contacts: number of times that it touched something.
    """

    model = UST_10LX
    turning: TurningDevice | OwnLidarEmulator | None = None
    """The lidar of a full circle in place of the Hokuyo, if any."""

    def __init__(
        self, world: World, side: Side, lidar: LidarSettings, laps: int | None, seed: int,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:  # fmt: skip
        self.world = world
        self.lidar = lidar
        self.surroundings = Surroundings(world, list(obstacles))
        self._side = side
        self._wanted_laps = laps
        self._rng = np.random.default_rng(seed)
        self._next_s = 0.0
        self._counter = LapCounter(world.lap) if world.lap is not None else None
        self._lap_started_s = 0.0
        self._crashed_s: float | None = None
        self._touches = False
        self._laps_before = 0
        self._time_s = 0.0
        self.back_to: Pose | None = None
        self.contacts = 0
        self.lap_times_s: list[float] = []

    @property
    def collided(self) -> bool:
        """Return whether the car touched anything."""
        return self._crashed_s is not None

    @property
    def finished(self) -> bool:
        """Return whether all laps were done, or the car crashed, a moment ago."""
        if self._crashed_s is not None and self.back_to is None:
            return self._time_s - self._crashed_s > AFTER_CRASH_S
        done = self._wanted_laps is not None and len(self.lap_times_s) >= self._wanted_laps
        return done and self._time_s - self._lap_started_s > AFTER_LAPS_S

    @property
    def ending(self) -> str:
        """Return why the drive has ended."""
        return "the car touched something" if self.collided and self.back_to is None else "its laps are done"

    def step(self, time_s: float, vehicle: Vehicle) -> bool:
        """Observe the car; count laps and detect contact."""
        self._time_s = time_s
        pose = vehicle.pose
        self.surroundings.update(time_s, pose, vehicle.speed_mps)
        contact = self.surroundings.collides(pose)
        if contact and self._crashed_s is None:
            self._crashed_s = time_s
        self.contacts += contact and not self._touches
        if self._touches and not contact:  # it was put back
            self._counter = LapCounter(self.world.lap) if self.world.lap is not None else None
            self._laps_before, self._lap_started_s = len(self.lap_times_s), time_s
        self._touches = contact
        laps = self._counter.update(pose.x_m, pose.y_m) if self._counter is not None else 0.0
        if laps >= len(self.lap_times_s) - self._laps_before + 1:
            self.lap_times_s.append(round(time_s - self._lap_started_s, 3))
            self._lap_started_s = time_s
        return contact

    def sample(self, time_s: float, vehicle: Vehicle) -> Sample:
        """Return the true state of the car in the world."""
        pose = vehicle.pose
        wall_m, clearance_m = self.world.wall_distance_m(pose, self._side), self.surroundings.clearance(pose)
        return Sample(time_s, pose.x_m, pose.y_m, pose.yaw_rad, vehicle.speed_mps, wall_m, clearance_m)

    def scan(self, time_s: float, vehicle: Vehicle) -> tuple[Ranges, int] | None:
        """Return the scan of a due revolution; revolutions missed by a late computer are skipped."""
        if time_s < self._next_s:
            return None
        period_s = self.model.period_s
        self._next_s += period_s * (1 + math.floor((time_s - self._next_s) / period_s))
        twist = Twist(vehicle.speed_mps, vehicle.yaw_rate_radps)
        return scan(self.surroundings, vehicle.pose, twist, time_s, self._rng, self.lidar), round(time_s * 1000)

    def see(self, vehicle: Vehicle, rays: Rays) -> Ranges:
        """Return what a lidar of a full circle measures now, mm."""
        return sector(self.surroundings, vehicle.pose, rays.bearing_rad, rays.start_m, self._rng, self.lidar)

    def outline_m(self) -> Floats:
        """Return walls and obstacles as segments (n, 4), to draw."""
        things = self.surroundings.obstacle_outline_m
        return np.vstack([self.world.outline_m, things]) if len(things) else self.world.outline_m

    def put(self, obstacle: Obstacle) -> None:
        """Add an obstacle, which appears at its time."""
        self.surroundings.put(obstacle)

    def clear(self) -> None:
        """Remove all obstacles."""
        self.surroundings.clear()


class RecordingScene:
    """Recording, played at the pace at which it was received; the car moves, but the scans do not depend on it."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.back_to: Pose | None = None
        self.model = sensor_of(recording)
        self.turning: TurningDevice | OwnLidarEmulator | None = None
        self._position = 0
        self._ranges_mm = to_sensor_mm(recording.ranges_m, recording.range_min_m, recording.range_max_m)
        # The sensor's clock must not start below zero: foreign stamps may lie far before the first scan.
        self._stamps_ms = np.rint((recording.stamp_s - recording.stamp_s.min()) * 1000).astype(np.int64)

    def see(self, _vehicle: Vehicle, rays: Rays) -> Ranges:
        """Return nothing: a recording has the scans of its own lidar only."""
        return np.zeros(rays.bearing_rad.size, np.int64)

    @property
    def finished(self) -> bool:
        """Return whether every scan was sent."""
        return self._position >= len(self.recording)

    @property
    def ending(self) -> str:
        """Return why the drive has ended."""
        return "the recording is played"

    def step(self, time_s: float, vehicle: Vehicle) -> bool:  # noqa: ARG002 - there is nothing to touch
        """Return no contact: the walls are unknown."""
        return False

    def sample(self, time_s: float, vehicle: Vehicle) -> Sample:
        """Return the pose of the emulated car."""
        pose = vehicle.pose
        return Sample(time_s, pose.x_m, pose.y_m, pose.yaw_rad, vehicle.speed_mps, math.inf, math.inf)

    def scan(self, time_s: float, vehicle: Vehicle) -> tuple[Ranges, int] | None:  # noqa: ARG002 - it does not care
        """Return the next recorded scan when its time has come."""
        if self.finished or time_s < self.recording.received_s[self._position]:
            return None
        position = self._position
        self._position += 1
        return self._ranges_mm[position], int(self._stamps_ms[position])

    def pairs(self, steering_rad: list[float]) -> list[ComparedSteering]:
        """Pair our answers with the recorded ones, where the recorded car was allowed to drive.

        Our answer to scan k is the servo command when scan k+1 was sent.
        """
        track = self.recording.navigation
        if track is None:
            return []
        ours = steering_rad[1:]
        times_s = [float(time_s) for time_s in self.recording.received_s[: len(ours)]]
        moved = drove(times_s, self.recording.output)
        return [
            ComparedSteering(time_s, our_rad, recorded_rad)
            for time_s, our_rad, recorded_rad, counts in zip(
                times_s, ours, recorded_answers(times_s, track, VehicleSettings().max_steering_rad), moved, strict=True
            )
            if counts and recorded_rad is not None
        ]


def sensor_of(recording: Recording) -> SensorModel:
    """Return the sensor that would produce scans of this shape; RecordingError for one that the car would refuse."""
    model = _sensor_of(recording)
    try:
        unfit = SensorParameters.from_fields(model.parameters()).unfit
    except ProtocolError as error:
        unfit = str(error)
    if unfit:
        raise RecordingError(f"{recording.name}: a car would not drive by its lidar, which {unfit}.")
    return model


def _sensor_of(recording: Recording) -> SensorModel:
    steps_per_turn = round(math.tau / recording.angle_step_rad)
    front = round(-recording.angle_min_rad / recording.angle_step_rad)
    first = max(0, -front)
    intervals_s = np.diff(recording.received_s)
    period_s = float(np.median(intervals_s)) if len(intervals_s) else UST_10LX.period_s
    return SensorModel(
        model=f"recorded {recording.name}"[:60],
        range_min_mm=max(1, round(recording.range_min_m * 1000)),
        range_max_mm=min(round(recording.range_max_m * 1000), SCIP_MAX_MM),
        steps_per_turn=steps_per_turn,
        first_step=first,
        last_step=first + recording.beams - 1,
        front_step=first + front,
        speed_rpm=max(1, round(60 / max(period_s, 1e-3))),
        product="recording",
        firmware="0",
        protocol="SCIP 2.0",
        serial="0",
    )
