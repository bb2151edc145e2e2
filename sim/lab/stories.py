"""`lab stories`: the whole process in virtual time: its own tasks and default laws, in-memory devices, a world.

The closed loop of the other experiments calls the laws one after the other; here the unmodified
`wallride.runtime.app.Car` runs, with its queues, expiries, permit and health monitor, and an event loop whose clock
jumps. Each story reports the expected and the actual result.
"""

import asyncio
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import DriveCommand, Source
from wallride.runtime.settings.tree import Settings
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.courses.walls import SMUDGES
from wallride.sim.lab.covers import Cover
from wallride.sim.lab.figures import TOUCH_ABOVE_MPS, Row, number, text
from wallride.sim.scenario.driven import STANDS_BELOW_MPS, DrivenScenario
from wallride.sim.scenario.faults import moments_of
from wallride.sim.scenario.scenario_parts import ScenarioFault
from wallride.sim.scenario.virtual_drive import SAMPLED_EVERY_S, Stage
from wallride.sim.virtual.twin_world import TwinWorld
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.obstacles import ConstantMotion, Obstacle, person, sudden_box
from wallride.sim.world.worlds import load_world

Event = tuple[float, Callable[[Stage], None]]


@dataclass(frozen=True, slots=True)
class Story:
    """A world, the events in it, and the expected result.

    says: the measured result, and whether it is as expected.
    """

    world: str
    lasts_s: float
    says: Callable[[DrivenScenario], list[tuple[str, bool]]]
    speed_mps: float = 2.0
    lidar: LidarSettings | None = None
    obstacles: tuple[Obstacle, ...] = ()
    events: tuple[Event, ...] = ()
    faults: tuple[ScenarioFault, ...] = ()
    permit: str = "always"
    backs_out: bool = True
    binds_teleop: bool = False


def tell(story: Story, seed: int = 1000) -> DrivenScenario:
    """Run a story in virtual time."""
    settings = Settings.model_validate(
        {
            "battery": {"settle_s": 0.0},
            "operator": {"permit": story.permit},
            "wall_follow": {"speed_mps": story.speed_mps},
            "safety": {"backs_out": story.backs_out, "binds_teleop": story.binds_teleop},
        }
    )

    async def main() -> DrivenScenario:
        loop = asyncio.get_running_loop()
        beams = story.lidar or LidarSettings(noise_std_m=0.02, outlier_share=0.02)
        twin = TwinWorld(load_world(story.world), loop.time, lidar=beams, obstacles=story.obstacles, seed=seed)
        stage = Stage(settings, twin)
        for at_s, event in story.events:
            loop.call_at(at_s, event, stage)
        for moment in moments_of(story.faults):
            loop.call_at(moment.at_s, moment.apply, stage, beams, stage.vehicle.settings.grip_mu)
        return await stage.play(story.lasts_s, to_rest=True)

    return run_virtual(main())


def cover_front(stage: Stage) -> None:
    """Cover the lidar's front, 120 degrees wide, without returns."""
    stage.twin.cover = Cover(None, 60.0, _PULLED_S, seed=0)


def uncover_front(stage: Stage) -> None:
    """Remove the cover."""
    stage.twin.cover = None


def swerve(stage: Stage) -> None:
    """Push the stick to full lock on the right at full speed, as a human does who sees the box come."""
    word = DriveCommand(Source.TELEOP, Drive(_BOXED_MPS, -stage.car.settings.car.max_steering_rad), None, "stick")
    stage.car.queue.put(word, expires_at_s=stage.clock() + 0.2)


def untouched(told: DrivenScenario) -> tuple[str, bool]:
    """Report whether there was a contact."""
    touched = told.contact_mps
    if touched is None:
        return "touches nothing", True
    return f"touched something at {touched:.2f} m/s", touched <= TOUCH_ABOVE_MPS


def within(what: str, measured_s: float, most_s: float) -> tuple[str, bool]:
    """Report a duration."""
    return f"{what} after {measured_s:.2f} s (at most {most_s:g})", measured_s <= most_s


def _laps(told: DrivenScenario) -> list[tuple[str, bool]]:
    best_s = min(told.laps_s[1:], default=math.inf)
    stood = told.stood_s(1.0) < told.time_s[-1] - 1.0
    return [untouched(told), (f"{len(told.laps_s)} laps, best {best_s:.2f} s", len(told.laps_s) >= 2),
            ("never stands", not stood)]  # fmt: skip


def _dirty(told: DrivenScenario) -> list[tuple[str, bool]]:
    return [
        untouched(told),
        within("sets off", told.went_s(0.0), 1.0),
        ("never stands", told.stood_s(1.0) == math.inf or told.stood_s(1.0) > told.time_s[-1] - 1.0),
        ("says: " + "; ".join(told.window), "clean the window" in " ".join(told.window)),
    ]


_CROSSES_S = 4.0
_PERSON = person(8.0, -2.6, ConstantMotion(0.0, 1.0, _CROSSES_S - 2.6, _CROSSES_S + 2.0))


def _crossing(told: DrivenScenario) -> list[tuple[str, bool]]:
    slowest = min(told.speed_mps[int(2.0 / SAMPLED_EVERY_S) : int(6.0 / SAMPLED_EVERY_S)])
    gone_s = _CROSSES_S + 0.5
    again_s = told.went_s(gone_s) - gone_s
    return [
        untouched(told),
        (f"gives way: slows to {slowest:.2f} m/s", slowest < 1.0),
        within("goes on", again_s, 5.0),
        (f"comes {told.pose[-1].x_m:.1f} m far", told.pose[-1].x_m > 12.0),
    ]


_PULLED_S, _BACK_S = 4.0, 7.0


def _lost(told: DrivenScenario, brakes_mps2: float, notices_s: float) -> list[tuple[str, bool]]:
    stood_s = told.stood_s(_PULLED_S)
    speed_mps = told.speed_at(_PULLED_S)
    allowed_s = round(notices_s + speed_mps / brakes_mps2, 2)
    moved = any(abs(v) > STANDS_BELOW_MPS for t, v in zip(told.time_s, told.speed_mps, strict=True)
                if stood_s < t < _BACK_S)  # fmt: skip
    return [
        untouched(told),
        within(f"from {speed_mps:.1f} m/s stands", stood_s - _PULLED_S, allowed_s),
        ("stays until it is back", not moved),
        within("goes on", told.went_s(_BACK_S) - _BACK_S, 5.0),
    ]


def _lidar_lost(told: DrivenScenario) -> list[tuple[str, bool]]:
    """Report the loss of the lidar: the last scan stays valid for 0.15 s; then the car brakes in full."""
    return _lost(told, 5.0, 0.25)


def _motor_lost(told: DrivenScenario) -> list[tuple[str, bool]]:
    """Report the loss of the motor: only the controller itself can brake, gently, after its own timeout."""
    return _lost(told, 1.9, 0.25)


def _front_covered(told: DrivenScenario) -> list[tuple[str, bool]]:
    """Report a covered front: the first covered scan is a full brake, and the first free one ends it."""
    said = next((reason for reason in told.reasons if reason.startswith("the lidar is blind")), "nothing of it")
    return [*_lost(told, 5.0, 0.1), (f"says: {said}", said != "nothing of it")]


_SAYS_SO = ("backing out", "turning out", "boxed in", "wall ahead", "waiting")


def _dead_end(told: DrivenScenario) -> list[tuple[str, bool]]:
    backed = sum(-v for v in told.speed_mps if v < -STANDS_BELOW_MPS) * SAMPLED_EVERY_S
    tried = sorted({reason for reason in told.reasons if reason.startswith(_SAYS_SO)})
    farthest = max(pose.x_m for pose in told.pose)
    out_m = farthest - told.pose[-1].x_m
    words = " and asks for help" if "needs help" in " ".join(told.navigation) else ""
    at_rest = told.reasons[-2] if abs(told.speed_mps[-2]) < STANDS_BELOW_MPS else ""
    return [
        untouched(told),
        (f"backs {backed:.1f} m", backed > 0.1),
        (f"comes {out_m:.1f} m out again{words}", out_m > 2.0 or not at_rest or at_rest.startswith(_SAYS_SO)),
        ("says: " + "; ".join(tried), bool(tried)),
    ]


_BOXED_S, _BOXED_MPS, _BOX_AHEAD_M = 5.0, 3.0, 0.9
_BOX = sudden_box(_BOX_AHEAD_M, width_m=4.0, from_s=_BOXED_S)
_SWERVES: tuple[Event, ...] = tuple((_BOXED_S - 0.1 + 0.05 * push, swerve) for push in range(40))


def _boxed(told: DrivenScenario) -> list[tuple[str, bool]]:
    """Report a box 0.75 m before the bumper at 3 m/s: the floor's whole grip stops the car with 6 cm to spare."""
    said = sorted({reason for reason in told.reasons if reason.startswith(("braking", "swerving"))})
    return [
        untouched(told),
        (f"drives at {told.speed_at(_BOXED_S - 0.2):.1f} m/s before", told.speed_at(_BOXED_S - 0.2) > 2.9),
        within("stands", told.stood_s(_BOXED_S) - _BOXED_S, 0.6),
        ("says: " + "; ".join(said), said == ["braking: wall ahead"]),
    ]


STORIES = {
    "laps of the loop": Story("loop", 26.0, _laps, speed_mps=3.0),
    "dirty window from the first scan on": Story(
        "loop", 15.0, _dirty, lidar=LidarSettings(noise_std_m=0.02, outlier_share=0.02, dirty_sectors=SMUDGES)
    ),
    "a person crosses": Story("straight", 11.0, _crossing, obstacles=(_PERSON,)),
    "lidar cable pulled and back": Story(
        "loop", 10.0, _lidar_lost, faults=(ScenarioFault(kind="lidar lost", after_s=_PULLED_S, until_s=_BACK_S),)
    ),
    "motor controller lost and back": Story(
        "loop", 10.0, _motor_lost, faults=(ScenarioFault(kind="motor lost", after_s=_PULLED_S, until_s=_BACK_S),)
    ),
    "lidar's front covered and free": Story(
        "loop", 10.0, _front_covered, events=((_PULLED_S, cover_front), (_BACK_S, uncover_front))
    ),
    "dead end": Story("dead_end", 30.0, _dead_end, speed_mps=2.0),
    "a box before the follower": Story("corridor", 7.0, _boxed, speed_mps=_BOXED_MPS, obstacles=(_BOX,)),
    "a box before a human who swerves": Story(
        "corridor", 7.0, _boxed, speed_mps=_BOXED_MPS, obstacles=(_BOX,), events=_SWERVES, binds_teleop=True
    ),
}
"""Stories by name."""


def cells(choice: CellChoice) -> list[Cell]:
    """Return the cells of the stories."""
    names = list(STORIES)[:2] if choice.quick else list(STORIES)
    return [
        Cell("stories", name, "ball+swept", STORIES[name].speed_mps, 0.8, "left", choice.seeds[0]) for name in names
    ]


def measure(cell: Cell) -> Figures:
    """Run one story."""
    story = STORIES[cell.scenario]
    logging.getLogger("wallride").addHandler(logging.NullHandler())  # the table reports it
    told = tell(story, cell.seed)
    said = story.says(told)
    return {
        "lasts_s": story.lasts_s,
        "way_m": number(told.way_m),
        "scans": len(told.time_s),
        "held": all(held for _, held in said),
        "said": [[what, held] for what, held in said],
    }


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return one table: a row per story."""
    lines = tuple(
        (
            row["scenario"],
            text(row["lasts_s"], 0),
            text(row["way_m"], 1),
            "as it should" if row["held"] else "NOT as it should",
            "\n".join(what if held else f"{what} !" for what, held in row["said"]),
        )
        for row in rows
    )
    return [TabledCell("the whole process in virtual time", ("story", "s", "way m", "ends", "what happened"), lines)]


def _no_picture(*_: object) -> None:
    """Return no picture: stories have none."""


EXPERIMENT = Experiment(measure, cells, tables, _no_picture)
