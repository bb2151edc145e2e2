"""The scene of a simulated drive, as the options of `wallride sim` name it: the world, its conditions, and the car."""

import argparse
import math

from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.scenario_scene import ScenarioScene
from wallride.sim.live.scenes import WorldScene
from wallride.sim.racing.race import Race, with_lap
from wallride.sim.scenario.conditions import Conditions, RequestedConditions, conditions_of
from wallride.sim.scenario.scenario_file import MAX_START_TO_WALL_M
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world

POSE_NUMBERS = 3


class SimUsageError(Exception):
    """Invalid command line; the text names the fault and the valid form."""


def build_scene(
    options: argparse.Namespace, settings: Settings, chosen: ScenarioScene | None = None
) -> tuple[Conditions, WorldScene, Vehicle]:
    """Return the world that the options name, or a scenario's, with a car in it. The line of a race is the lap."""
    if chosen is not None:
        return chosen.conditions, chosen, chosen.vehicle
    side = settings.wall_follow.side
    world = asked_world(options, settings)
    conditions = conditions_of(wishes(options))
    race: Race | None = options.race
    begin = race.start_in(world) if race is not None else world.start
    vehicle = Vehicle(conditions.vehicle, parse_pose(options.pose) if options.pose else begin)
    world = with_lap(world, race) if race is not None else world
    start = f"--pose {options.pose}" if options.pose else f"the start in {world.name}"
    if not world.clearance(vehicle.pose) <= MAX_START_TO_WALL_M:  # NaN is nowhere
        left_m, bottom_m, right_m, top_m = world.bounds_m
        raise SimUsageError(
            f"{start}: no wall is within {MAX_START_TO_WALL_M:.0f} m;"
            f" the walls of {world.name} lie at x {left_m:.1f} to {right_m:.1f} m, y {bottom_m:.1f} to {top_m:.1f} m"
        )
    if world.collides(vehicle.pose):
        raise SimUsageError(f"{start}: the car would stand in a wall of {world.name}; give a --pose where it is free")
    scene = WorldScene(world, side, conditions.lidar, options.laps, options.seed, conditions.things())
    return conditions, scene, vehicle


def asked_world(options: argparse.Namespace, settings: Settings) -> World:
    """Return the world that the options name, with the wall on the side of a race's map, else on the followed one."""
    side = (options.race.side if options.race is not None else None) or settings.wall_follow.side
    try:
        return load_world(options.world, side=side, seed=options.seed)
    except (ValueError, OSError) as error:
        raise SimUsageError(str(error)) from None


def wishes(options: argparse.Namespace) -> RequestedConditions:
    """Return the conditions that the options ask for."""
    return RequestedConditions(
        file=options.conditions,
        assignments=options.condition,
        friction=options.friction,
        noise_m=options.noise,
        dropouts=options.dropouts,
        trim_rad=options.trim,
        delay_s=options.delay,
        own_parts=options.own_parts,
        dirt=options.dirt,
        obstacles=options.obstacle,
    )


def parse_pose(text: str) -> Pose:
    """Read X,Y,THETA in metres and radians."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != POSE_NUMBERS or not all(map(math.isfinite, numbers)):
        raise SimUsageError(f"--pose {text}: write three numbers X,Y,THETA [m, m, rad], for example --pose 3,1,0")
    return Pose(*numbers)
