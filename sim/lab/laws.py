"""Laws under test by name: the only place of the lab that constructs them.

"ball" is a follower with the safety that belongs to it; "ball+report" names both; "report+none" drives without safety.
"prototype" is a baseline that only the lab has (`wallride.sim.lab.courses.prototype`). "my_laws:Follower" is a class of
the user, and "my_laws:Follower+my_laws:Guard" one of the user's safety laws beside the car's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wallride.runtime.arbitration.command import Source
from wallride.runtime.control.guidance import Follower, Guard
from wallride.runtime.control.laws import FOLLOWERS, SAFETY, LawStack, Parts
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.own_laws.law_class import OWN_TAG, is_own, load_law
from wallride.runtime.host.terminal_text import complain
from wallride.runtime.line_files import read_course
from wallride.runtime.settings.driven_car import driven_car
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.driven_line import course_in
from wallride.sim.lab.courses.prototype import Prototype
from wallride.sim.lab.courses.sudden import BlindDriver
from wallride.sim.scenario.conditions import put_on_top
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.pose import Side

GUARD_OF = {name: name if name in SAFETY else "swept" for name in (*FOLLOWERS, "prototype") if name != OWN_TAG}
"""Guard of every follower on the car."""
GUARDS = (*sorted({*SAFETY} - {OWN_TAG}), "none")


def check(law: str) -> str:
    """Return the law's full name "follower+guard"; ValueError for an unknown name."""
    follower, _, guard = law.partition("+")
    for section, name in (("wall_follow", follower), ("safety", guard)):
        if is_own(name):
            load_law(section, name)
    guard = guard or ("swept" if is_own(follower) else GUARD_OF.get(follower, ""))
    if not (follower in GUARD_OF or is_own(follower)) or not (guard in GUARDS or is_own(guard)):
        raise ValueError(
            f"no law is called {law!r}; write one of {', '.join(GUARD_OF)}, or MODULE:CLASS of your own,"
            f" or with another safety FOLLOWER+GUARD, guards being {', '.join(GUARDS)}"
        )
    return f"{follower}+{guard}"


def own_law_files(law: str) -> list[Path]:
    """Return the files of a law that are the user's: of its follower, of its safety, of what they import."""
    follower, _, guard = law.partition("+")
    chosen = [(section, name) for section, name in (("wall_follow", follower), ("safety", guard)) if is_own(name)]
    return [file for section, name in chosen for file in load_law(section, name).files]


def settings_of(law: str, side: Side, desired_m: float, speed_mps: float, assignments: Sequence[str] = ()) -> Settings:
    """Return the car's default settings but for law, side, distance and speed, with KEY=VALUE texts on top.

    Raises SettingsError for an assignment that the law does not have.
    """
    wanted = [
        *assignments_of(law),
        f"wall_follow.side={side}",
        f"wall_follow.desired_distance_m={desired_m}",
        f"wall_follow.speed_mps={speed_mps}",
    ]
    return load_settings(None, [*wanted, *assignments], laws=True)


def assignments_of(law: str) -> list[str]:
    """Return the settings that choose a law, as KEY=VALUE; those of a prototype are those of `ball`."""
    follower, _, guard = check(law).partition("+")
    method = f"wall_follow.method={follower if follower != 'prototype' else 'ball'}"
    if guard == "none":  # without safety, neither of its rules applies
        return [method, "safety.method=report", "safety.turn_below_m=0"]
    return [method, f"safety.method={guard}"]


def build(
    law: str, side: Side, desired_m: float, speed_mps: float, assignments: Sequence[str] = (),
    course: RaceCourse | None = None,
) -> tuple[Follower, Guard | None]:  # fmt: skip
    """Return fresh laws with the settings of `settings_of`."""
    laws = stack_of(law, settings_of(law, side, desired_m, speed_mps, assignments), course)
    return laws.follower, None if check(law).endswith("+none") else laws.judge


def stack_of(law: str, settings: Settings, course: RaceCourse | None = None, *, servo: bool = False) -> LawStack:
    """Return the fresh stack of laws, on a course or the map that the settings name. Raises: SettingsError, MapError.

    "none" is the report's safety with both rules off. servo: the laws know the limits of the servo, as on the car.
    """
    follow = settings.wall_follow

    def prototype(parts: Parts) -> Prototype:
        views = parts.perception.views
        return Prototype(follow.side, follow.desired_distance_m, follow.speed_mps, parts.car, views)

    driver = prototype if check(law).startswith("prototype+") else None
    course = course or read_course(settings.map, settings.car)
    car = driven_car(settings) if servo else settings.car
    return LawStack(settings.wall_follow, settings.safety, car, driver=driver, course=course)


def stack_in(cell: Cell, case: Case, assignments: Sequence[str] = (), blind: Follower | None = None) -> LawStack:
    """Return the fresh stack of a cell's laws; `line` without a map gets one of the case's walls.

    Its line is the way of `ball`, or that of a blind driver, and its first lap is at full speed.
    """
    known: tuple[str, ...] = (*cell.settings, *assignments)
    servo = case.wiring is not None  # else the simulated wheels reach what they are asked for
    asked = (cell.law, cell.side, case.desired_m, cell.speed_mps)
    if not needs_line(cell):
        return stack_of(cell.law, settings_of(*asked, known), servo=servo)
    ball, _ = build("ball", cell.side, case.desired_m, cell.speed_mps)
    course = course_in(case, blind or ball, cell.speed_mps, blind=blind is not None)
    known = ("wall_follow.first_lap_share=1", f"wall_follow.floor_mu={cell.mu}", *known)
    return stack_of(cell.law, settings_of(*asked, known), course, servo=servo)


def needs_line(cell: Cell) -> bool:
    """Return whether a cell's law drives by a line, and its settings name no map."""
    return check(cell.law).startswith("line+") and not any(text.startswith("map.") for text in cell.settings)


def own_law_faults(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the faults of the user's laws that stopped a car, each once."""
    return sorted({str(row["law_fault"]) for row in rows if row.get("law_fault")})


def tell_own_law_faults(rows: Sequence[Mapping[str, Any]]) -> int:
    """Say on standard error which of the user's laws stopped a car; return the exit code, 0 where none did."""
    faults = own_law_faults(rows)
    for fault in faults:
        complain(f"the car stood: {fault}")
    return 1 if faults else 0


def drive_case(cell: Cell, case: Case, navigator: Follower | None = None, guard: Guard | None = None) -> SimulatedRun:
    """Drive a case with the laws, settings, conditions and own parts of a cell, at the case's distance to the wall.

    navigator, guard: in place of the law's own. Where the law drives by a line, the way of a blind navigator is the
    line, which the law's own navigator drives.
    """
    blind = navigator if isinstance(navigator, BlindDriver) and case.driver is Source.NAVIGATION else None
    if blind is not None and needs_line(cell):
        navigator = None
    laws = stack_in(cell, case, blind=blind)
    built = None if check(cell.law).endswith("+none") else laws.judge
    if cell.settings:
        car = settings_of(cell.law, cell.side, case.desired_m, cell.speed_mps, cell.settings).car
        case = replace(case, car=car)
    vehicle, lidar = put_on_top(cell.conditions, case.vehicle, case.lidar)
    lidar = lidar.model_copy(update={"own_parts": cell.own_parts})
    done = drive(replace(case, vehicle=vehicle, lidar=lidar), navigator or laws.follower, guard or built)
    done.law_fault = laws.own_law_fault
    return done
