"""Drives in the simulator from Python, for notebooks and tests: `run(world, law)` returns what was driven, as arrays.

from wallride.lab import run
driven = run("loop", "my_laws:Follower", settings={"wall_follow.own.kp": 2.0}, duration_s=30)
plt.plot(driven.pose[:, 0], driven.pose[:, 1])
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wallride.runtime.control.own_laws.law_class import is_own, register
from wallride.runtime.host.user_module import refuse_others_than_in
from wallride.sim.lab.sweep.drive_cell import DriveCell, LawError, drive_setup, setup_of
from wallride.sim.virtual.closed_loop import SimulatedRun

__all__ = ["LawError", "run"]
FRICTION_MU = 0.8


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

    Raises LawError where the law fails, SettingsError and ValueError for wrong settings and worlds, UserCodeError where
    the law's file was imported from another folder before.
    """
    if not isinstance(law, str):  # a class is known by its module and name from now on
        law = register("wall_follow", f"{law.__module__}:{law.__name__}", law).name
    elif is_own(law):
        refuse_others_than_in(Path.cwd().resolve())
    wanted = {"wall_follow.method": law, **(settings or {})}
    conditions = {"world": world, "duration_s": duration_s, "seed": seed, "vehicle.grip_mu": friction_mu}
    return drive_setup(setup_of(DriveCell.of({**conditions, **wanted})))
