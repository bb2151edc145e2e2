"""A scenario in virtual time: the whole process with in-memory devices, seconds of driving in tenths of a second."""

import asyncio

from wallride.runtime.app import Car
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.scenario.driven import DrivenScenario
from wallride.sim.scenario.faults import moments_of
from wallride.sim.scenario.scenario_file import Scenario
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import UNPLUGGED_AFTER_S, TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.lap import LapCounter

SAMPLED_EVERY_S = 0.025


def drive_scenario(scenario: Scenario) -> DrivenScenario:
    """Drive a scenario to its end, or to half a second after a contact; the same one gives the same record."""
    return run_virtual(_Stage(scenario).play())


class _Stage:
    """Car, devices and world of one run. Implements FaultyCar."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._driven = DrivenScenario()
        self._stop = asyncio.Event()

    @property
    def vehicle(self) -> Vehicle:
        return self._twin.vehicle

    @property
    def lidar(self) -> LidarSettings:
        return self._twin.lidar_settings

    def set_lidar(self, lidar: LidarSettings) -> None:
        self._twin.lidar_settings = lidar

    def plug_lidar(self, *, plugged: bool) -> None:
        if plugged:
            self._lidar.plug()
        else:
            self._lidar.pull()

    def plug_motor(self, *, plugged: bool) -> None:
        if plugged:
            self._motor.plug()
        else:
            self._motor.pull()
            asyncio.get_running_loop().call_later(UNPLUGGED_AFTER_S, self._motor.brake_by_itself)

    async def play(self) -> DrivenScenario:
        """Drive, with the faults at their times."""
        scenario, loop = self._scenario, asyncio.get_running_loop()
        conditions = scenario.conditions
        self._twin = TwinWorld(
            scenario.world, loop.time, start=scenario.start, vehicle=conditions.vehicle, lidar=conditions.lidar,
            obstacles=scenario.obstacles, seed=scenario.content.seed,
        )  # fmt: skip
        self._lidar, self._motor = WorldLidar(self._twin, loop.time), WorldMotor(self._twin, loop.time)
        bus = MemoryBus(loop.time, listened_to=False)
        self._car = Car(_virtual(scenario.settings), self._lidar, self._motor, bus, loop.time)
        for moment in moments_of(scenario.content.fault):
            grip_mu = conditions.vehicle.grip_mu
            loop.call_at(moment.at_s, moment.apply, self, conditions.lidar, grip_mu)
        loop.call_at(scenario.content.duration_s, self._stop.set)
        sampling = loop.create_task(self._sample())
        try:
            await self._car.drive(self._stop)
        finally:
            sampling.cancel()
        return self._driven

    async def _sample(self) -> None:
        """Write down the truth until cancelled; a contact ends the drive."""
        driven, twin, loop = self._driven, self._twin, asyncio.get_running_loop()
        side = self._scenario.settings.wall_follow.side
        counter = LapCounter(twin.world.lap) if twin.world.lap is not None else None
        begun_s = 0.0
        while not self._stop.is_set():
            await asyncio.sleep(SAMPLED_EVERY_S)
            twin.advance()
            output, pose, now_s = self._car.mux.output, twin.vehicle.pose, loop.time()
            driven.time_s.append(now_s)
            driven.pose.append(pose)
            driven.speed_mps.append(twin.vehicle.speed_mps)
            driven.wall_m.append(twin.world.wall_distance_m(pose, side))
            driven.clearance_m.append(twin.scene.clearance(pose))
            driven.reasons.append(output.decision.reason if output is not None else "")
            driven.note_distances(now_s, pose, twin.scene)
            if counter is not None and counter.update(pose.x_m, pose.y_m) >= len(driven.laps_s) + 1:
                driven.laps_s.append(now_s - begun_s)
                begun_s = now_s
            if twin.contact_mps is not None:
                driven.contact_mps = twin.contact_mps
                self._stop.set()


def _virtual(settings: Settings) -> Settings:
    """Return the settings without what needs a disk."""
    recording = settings.recording.model_copy(update={"enabled": False})
    process = settings.process.model_copy(update={"state_folder": ""})
    return settings.model_copy(update={"recording": recording, "process": process})
