"""A drive in virtual time: the whole process with in-memory devices, seconds of driving in tenths of a second."""

import asyncio

from wallride.drivers.vesc.app_config import RECOMMENDED_TIMEOUT_S
from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.arbitration.command import DriveCommand
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.line_files import read_raced_course
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.figures.summary import Sample
from wallride.sim.scenario.driven import DrivenScenario
from wallride.sim.scenario.faults import moments_of
from wallride.sim.scenario.scenario_file import Scenario
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.lap import LapCounter

SAMPLED_EVERY_S = 0.025


def drive_scenario(scenario: Scenario) -> DrivenScenario:
    """Drive a scenario to its end, or to half a second after a contact; the same one gives the same record."""
    conditions, content = scenario.conditions, scenario.content

    async def main() -> DrivenScenario:
        loop = asyncio.get_running_loop()
        twin = TwinWorld(
            scenario.world, loop.time, start=scenario.start, vehicle=conditions.vehicle,
            lidar=conditions.lidar, obstacles=scenario.obstacles, seed=content.seed,
        )  # fmt: skip
        settings = scenario.settings
        stage = Stage(_virtual(settings), twin, read_raced_course(settings.wall_follow, settings.map, settings.car))
        for moment in moments_of(content.fault):
            loop.call_at(moment.at_s, moment.apply, stage, conditions.lidar, conditions.vehicle.grip_mu)
        return await stage.play(content.duration_s)

    return run_virtual(main())


class Stage:
    """Car, devices and world of one drive, and its record. Implements FaultyCar."""

    def __init__(self, settings: Settings, twin: TwinWorld, course: RaceCourse | None = None) -> None:
        self._loop = asyncio.get_running_loop()
        self.clock = self._loop.time
        self.twin = twin
        self.sensor, self.motor = WorldLidar(twin, self.clock), WorldMotor(twin, self.clock)
        bus, beside = MemoryBus(self.clock, listened_to=False), CarSurroundings(course=course)
        self.car = Car(settings, self.sensor, self.motor, bus, self.clock, beside)
        self.driven = DrivenScenario(wire=self.motor.wire)
        self._stop = asyncio.Event()

    @property
    def vehicle(self) -> Vehicle:
        """Return the car's body."""
        return self.twin.vehicle

    @property
    def lidar(self) -> LidarSettings:
        """Return the conditions of its lidar."""
        return self.twin.lidar_settings

    def set_lidar(self, lidar: LidarSettings) -> None:
        """Change the conditions of its lidar."""
        self.twin.lidar_settings = lidar

    def plug_lidar(self, *, plugged: bool) -> None:
        """Pull the lidar's cable, or plug it in."""
        if plugged:
            self.sensor.plug()
        else:
            self.sensor.pull()

    def plug_motor(self, *, plugged: bool) -> None:
        """Pull the motor controller's cable, after which it brakes by itself, or plug it in."""
        if plugged:
            self.motor.plug()
        else:
            self.motor.pull()
            self._loop.call_later(RECOMMENDED_TIMEOUT_S, self.motor.brake_by_itself)

    async def play(self, lasts_s: float, *, to_rest: bool = False) -> DrivenScenario:
        """Drive, and return the record up to a contact or the time. to_rest: up to where the car rests after it."""
        self._loop.call_at(lasts_s, self._stop.set)
        sampling = self._loop.create_task(self._sample(to_rest=to_rest))
        try:
            await self.car.drive(self._stop)
        finally:
            sampling.cancel()
        return self.driven

    async def _sample(self, *, to_rest: bool) -> None:
        driven, twin = self.driven, self.twin
        counter = LapCounter(twin.world.lap) if twin.world.lap is not None else None
        side, lap_from_s = self.car.settings.wall_follow.side, 0.0
        while to_rest or not self._stop.is_set():
            await asyncio.sleep(SAMPLED_EVERY_S)
            twin.advance()
            vehicle, pose, now_s = twin.vehicle, twin.vehicle.pose, self.clock()
            wall_m, clearance_m = twin.world.wall_distance_m(pose, side), twin.scene.clearance(pose)
            sample = Sample(now_s, pose.x_m, pose.y_m, pose.yaw_rad, vehicle.speed_mps, wall_m, clearance_m)
            driven.note(sample, twin.scene)
            self._note_decision()
            if counter is not None and counter.update(pose.x_m, pose.y_m) >= len(driven.laps_s) + 1:
                driven.laps_s.append(now_s - lap_from_s)
                lap_from_s = now_s
            driven.contact_mps = twin.contact_mps
            if driven.contact_mps is not None and not to_rest:
                self._stop.set()

    def _note_decision(self) -> None:
        driven, output = self.driven, self.car.mux.output
        driven.reasons.append(output.decision.reason if output is not None else "")
        driven.window = tuple(self.car.laws.words)
        driven.law_fault = driven.law_fault or self.car.laws.own_law_fault
        driven.way_m = self.twin.way_m
        for command in self.car.queue.live():
            if isinstance(command, DriveCommand) and command.reason not in driven.navigation[-1:]:
                driven.navigation.append(command.reason)


def _virtual(settings: Settings) -> Settings:
    """Return the settings without what needs a disk."""
    recording = settings.recording.model_copy(update={"enabled": False})
    process = settings.process.model_copy(update={"state_folder": ""})
    return settings.model_copy(update={"recording": recording, "process": process})
