"""The user's laws and drivers in a simulated drive, and their faults, as a car's status tells them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from wallride.runtime.control.own_laws.law_class import is_own
from wallride.runtime.own_drivers.settings import OwnLidarSettings, OwnMotorSettings
from wallride.runtime.settings.tree import Settings

GATES: Final = ("lidar", "motor", "safety", "navigation")
FAULTY: Final = "faulty: "
AGAIN: Final = "; permit again"


@dataclass(frozen=True, slots=True)
class UserCode:
    """Names of the user's laws and drivers with which a car drives. lidar, motor: "" where that driver is built in."""

    laws: tuple[str, ...] = ()
    lidar: str = ""
    motor: str = ""

    @classmethod
    def of(cls, settings: Settings) -> Self:
        """Return those of settings."""
        lidar, motor = settings.lidar, settings.motor
        return cls(
            tuple(name for name in (settings.wall_follow.method, settings.safety.method) if is_own(name)),
            lidar.driver if isinstance(lidar, OwnLidarSettings) else "",
            motor.driver if isinstance(motor, OwnMotorSettings) else "",
        )

    def faults(self, reasons: Iterable[str]) -> list[str]:
        """Return those reasons that are faults of it: each names the law or driver first."""
        begins = tuple(f"{name}{mark}" for name in (*self.laws, self.lidar, self.motor) if name for mark in " :")
        return [reason for reason in reasons if begins and reason.startswith(begins)]

    def faults_in(self, status: Mapping[str, Any]) -> frozenset[str]:
        """Return its faults in a status: in the gates and in the reason of the decision."""
        gates = status.get("gates") or {}
        reasons = [str(gates.get(name, "")).removeprefix(FAULTY) for name in GATES]
        reasons.append(str((status.get("output") or {}).get("reason", "")).removesuffix(AGAIN))
        return frozenset(self.faults(reasons))


NO_USER_CODE: Final = UserCode()
