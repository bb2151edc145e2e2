"""A scenario's file in real time: its world, its faults on the emulated devices, the record that is judged."""

import argparse
from pathlib import Path

from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.figures.summary import Sample
from wallride.sim.live.scenes import WorldScene
from wallride.sim.scenario.driven import DrivenScenario
from wallride.sim.scenario.faults import moments_of
from wallride.sim.scenario.scenario_file import Scenario, load_scenario
from wallride.sim.world.beams import LidarSettings

SUFFIX = ".toml"


def read_scenario(options: argparse.Namespace, config: Path) -> Scenario | None:
    """Return the scenario that the options name, None for another world; FileMistakeError names its mistake.

    Its settings and its duration become those of the options, unless they have their own.
    """
    if not str(options.world).endswith(SUFFIX):
        return None
    scenario = load_scenario(Path(options.world), config, options.assignments)
    options.assignments = list(scenario.assignments)
    options.duration = options.duration or scenario.content.duration_s
    return scenario


class ScenarioScene(WorldScene):
    """World of a scenario. driven: what its expectations are about. Implements FaultyCar."""

    def __init__(self, scenario: Scenario, laps: int | None) -> None:
        side, seed = scenario.settings.wall_follow.side, scenario.content.seed
        super().__init__(scenario.world, side, scenario.conditions.lidar, laps, seed, scenario.obstacles)
        self.conditions = scenario.conditions
        self.vehicle = Vehicle(scenario.conditions.vehicle, scenario.start)
        self.driven = DrivenScenario(laps_s=self.lap_times_s)
        self._moments = moments_of(scenario.content.fault)
        self._scip: ScipEmulator | None = None
        self._vesc: VescEmulator | None = None

    def attach(self, scip: ScipEmulator, vesc: VescEmulator) -> None:
        """Note the emulated devices, whose cables the faults pull."""
        self._scip, self._vesc = scip, vesc

    def set_lidar(self, lidar: LidarSettings) -> None:
        """Change the lidar's conditions."""
        self.lidar = lidar

    def plug_lidar(self, *, plugged: bool) -> None:
        """Pull the lidar's network cable, or plug it in."""
        if self._scip is not None and plugged:
            self._scip.listen_again()
        elif self._scip is not None:
            self._scip.refuse()
            self._scip.disconnect()

    def plug_motor(self, *, plugged: bool) -> None:
        """Pull the motor controller's USB cable, or plug it in."""
        if self._vesc is not None and plugged:
            self._vesc.replug()
        elif self._vesc is not None:
            self._vesc.unplug()

    def step(self, time_s: float, vehicle: Vehicle) -> bool:
        """Apply the faults that are due, and observe the car."""
        while self._moments and self._moments[0].at_s <= time_s:
            self._moments.pop(0).apply(self, self.conditions.lidar, self.conditions.vehicle.grip_mu)
        speed_mps = abs(vehicle.speed_mps)
        contact = super().step(time_s, vehicle)
        if contact and self.driven.contact_mps is None:
            self.driven.contact_mps = speed_mps
        return contact

    def sample(self, time_s: float, vehicle: Vehicle) -> Sample:
        """Return the true state of the car, and write it down."""
        sample = super().sample(time_s, vehicle)
        self.driven.note(sample, self.surroundings)
        return sample
