"""One simulated drive by a law, in virtual time."""

import json
from collections.abc import Mapping
from typing import Any

from runtime.control import methods
from runtime.control.own_laws.follower import OwnFollower
from runtime.control.own_laws.guard import CappedGuard
from runtime.control.own_laws.law_class import register
from runtime.control.perception.view import PerceptionCache
from runtime.settings.tree import Settings, load_settings
from sim.car.vehicle_settings import VehicleSettings
from sim.virtual.closed_loop import Case, SimulatedRun, drive
from sim.world.worlds import load_world

FRICTION_MU = 0.8


class LawError(Exception):
    """A law of one's own has failed; the text names file and line."""


def run(
    world: str = "loop",
    law: str | type[Any] = "ball",
    *,
    settings: Mapping[str, Any] | None = None,
    duration_s: float = 60.0,
    friction_mu: float = FRICTION_MU,
    seed: int = 0,
) -> SimulatedRun:
    """Drive with the car's default settings and return what was driven, one row per scan; ends at a contact.

    world: a built-in world or a ROS map .yaml. law: "ball", "report", "my_laws:Follower" or the class itself.
    settings: by dotted names, {"wall_follow.speed_mps": 2, "wall_follow.own.kp": 1.5, "safety.method": "report"}.

    Raises LawError where the law fails, SettingsError and ValueError for wrong settings and worlds.
    """
    chosen = _settings(law, settings or {})
    wall_follow = chosen.wall_follow
    if mistakes := methods.own_law_mistakes(wall_follow, chosen.safety, chosen.car):
        raise LawError("; ".join(mistakes))
    eyes = PerceptionCache(chosen.car)
    driver = methods.driver_for(wall_follow, chosen.car, eyes)
    guard = methods.guard_for(chosen.safety, chosen.car, eyes, None)
    follower = methods.wrapped(driver, guard, methods.recovery_for(chosen.safety), wall_follow)
    case = Case(
        load_world(world, side=wall_follow.side, seed=seed), desired_m=wall_follow.desired_distance_m,
        duration_s=duration_s, car=chosen.car, seed=seed, side=wall_follow.side,
        vehicle=VehicleSettings(grip_mu=friction_mu, max_steering_rad=chosen.car.max_steering_rad),
    )  # fmt: skip
    judge = methods.capped(guard, chosen.safety, wall_follow, None)
    driven = drive(case, follower, judge)
    failed = [own.runner.fault for own in (driver, judge) if isinstance(own, OwnFollower | CappedGuard)]
    if any(failed):
        raise LawError("; ".join(filter(None, failed)))
    return driven


def _settings(law: str | type[Any], wanted: Mapping[str, Any]) -> Settings:
    """Return the settings in force. A class is known by its module and name from now on."""
    if not isinstance(law, str):
        law = register("wall_follow", f"{law.__module__}:{law.__name__}", law).name
    return load_settings(
        None, [f"wall_follow.method={law}", *(f"{name}={json.dumps(value)}" for name, value in wanted.items())]
    )
