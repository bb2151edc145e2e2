"""Faults of a scenario as moments: what is changed, when, on any kind of emulated car."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from wallride.sim.car.vehicle import Vehicle
from wallride.sim.scenario.scenario_parts import ScenarioFault
from wallride.sim.world.beams import LidarSettings

COVERED_M = 0.02
"""Range up to which a covered beam sees: nothing that the sensor would report."""


class FaultyCar(Protocol):
    """An emulated car whose devices fail on command."""

    @property
    def vehicle(self) -> Vehicle:
        """Return the car's body."""

    @property
    def lidar(self) -> LidarSettings:
        """Return the conditions of its lidar."""

    def set_lidar(self, lidar: LidarSettings) -> None:
        """Change the conditions of its lidar."""

    def plug_lidar(self, *, plugged: bool) -> None:
        """Pull the lidar's cable, or plug it in."""

    def plug_motor(self, *, plugged: bool) -> None:
        """Pull the motor controller's cable, or plug it in."""


@dataclass(frozen=True, slots=True)
class FaultMoment:
    """Begin or end of a fault."""

    at_s: float
    fault: ScenarioFault
    begins: bool

    def apply(self, car: FaultyCar, at_start: LidarSettings, grip_mu: float) -> None:
        """Change the car. at_start, grip_mu: what holds again after the end."""
        fault = self.fault
        match fault.kind:
            case "lidar lost":
                car.plug_lidar(plugged=not self.begins)
            case "motor lost":
                car.plug_motor(plugged=not self.begins)
            case "slippery floor":
                mu = fault.grip_mu if self.begins else grip_mu
                car.vehicle.change(car.vehicle.settings.model_copy(update={"grip_mu": mu}))
            case "noisy lidar":
                noise_m = fault.noise_m if self.begins else at_start.noise_std_m
                car.set_lidar(car.lidar.model_copy(update={"noise_std_m": noise_m}))
            case "lidar covered":
                covered = (fault.from_deg, fault.to_deg, COVERED_M)
                sectors = [sector for sector in car.lidar.dirty_sectors if sector != covered]
                update = {"dirty_sectors": (*sectors, covered) if self.begins else tuple(sectors)}
                car.set_lidar(car.lidar.model_copy(update=update))


def moments_of(faults: Sequence[ScenarioFault]) -> list[FaultMoment]:
    """Return the begins and ends of faults in order of time."""
    return sorted(_moments(faults), key=lambda moment: moment.at_s)


def _moments(faults: Sequence[ScenarioFault]) -> Iterator[FaultMoment]:
    for fault in faults:
        yield FaultMoment(fault.after_s, fault, begins=True)
        if fault.until_s is not None:
            yield FaultMoment(fault.until_s, fault, begins=False)
