"""Conditions of a running drive: changed by a key in the terminal or a button on the page.

Lives in the simulator's process alone. The car receives no message: it only measures the change with its lidar and its
wheels.
"""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.scenes import WorldScene
from wallride.sim.scenario.conditions import Conditions, own_parts_fields, own_parts_kinds, own_parts_of
from wallride.sim.world.obstacles import LIDAR_AHEAD_M, ConstantMotion, Obstacle, Round, StandingObstacle, sudden_box

BOX_AHEAD_M = 1.0
PERSON_AHEAD_M, PERSON_ASIDE_M, PERSON_MPS = 2.0, 1.5, 0.8
DIRT = (-12.0, 6.0, 0.05)
GRIPS = (0.3, 0.4, 0.5, 0.65, 0.8, 1.0)
NOISES_M = (0.0, 0.01, 0.02, 0.03, 0.05)
SHARES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.64)
TRIMS_RAD = (-0.06, -0.04, -0.02, 0.0, 0.02, 0.04, 0.06)
DELAYS_S = (0.0, 0.02, 0.04, 0.06, 0.1)


@dataclass(frozen=True, slots=True)
class Action:
    """An action. key: in the terminal. words: label of a button."""

    name: str
    key: str
    words: str


ACTIONS = (
    Action("box", "b", "Put a box 1 m ahead now"),
    Action("person", "p", "Let a person cross 2 m ahead"),
    Action("clear", "c", "Take all obstacles away"),
    Action("grip_down", "f", "Less grip"),
    Action("grip_up", "F", "More grip"),
    Action("noise_down", "n", "Less noise"),
    Action("noise_up", "N", "More noise"),
    Action("dropouts_down", "o", "Fewer dropouts"),
    Action("dropouts_up", "O", "More dropouts"),
    Action("trim_down", "t", "Trim to the right"),
    Action("trim_up", "T", "Trim to the left"),
    Action("delay_down", "l", "Less delay"),
    Action("delay_up", "L", "More delay"),
    Action("dirt", "d", "Dirt on the window, on or off"),
    Action("parts", "w", "Other own parts"),
)
KEYS: Mapping[str, str] = {action.key: action.name for action in ACTIONS}


class LiveConditions:
    """Changes the conditions of a drive. at_start: the initial ones. done: number of actions."""

    def __init__(self, vehicle: Vehicle, surface: WorldScene, at_start: Conditions) -> None:
        self._vehicle = vehicle
        self._surface = surface
        self._dirt = at_start.lidar.dirty_sectors or (DIRT,)
        self.done = 0
        self._actions: Mapping[str, Callable[[], None]] = {
            "box": lambda: surface.put(sudden_box(BOX_AHEAD_M)),
            "person": self._person,
            "clear": surface.clear,
            "dirt": self._toggle_dirt,
            "parts": self._next_parts,
            **self._steps("grip", GRIPS, lambda: vehicle.settings.grip_mu, self._vehicle_fields("grip_mu")),
            **self._steps("noise", NOISES_M, lambda: surface.lidar.noise_std_m, self._lidar_field("noise_std_m")),
            **self._steps("dropouts", SHARES, lambda: surface.lidar.dropout_share, self._lidar_field("dropout_share")),
            **self._steps("trim", TRIMS_RAD, lambda: vehicle.settings.trim_rad, self._vehicle_fields("trim_rad")),
            **self._steps(
                "delay", DELAYS_S, lambda: vehicle.settings.steering_delay_s,
                self._vehicle_fields("steering_delay_s", "drive_delay_s"),
            ),
        }  # fmt: skip

    def do(self, name: str) -> None:
        """Perform one of ACTIONS; KeyError for an unknown one."""
        self._actions[name]()
        self.done += 1

    def fields(self) -> dict[str, Any]:
        """Return the present conditions for display: names with units, and values."""
        vehicle, lidar = self._vehicle.settings, self._surface.lidar
        return {
            "grip": f"{vehicle.grip_mu:g}",
            "noise": f"{lidar.noise_std_m * 100:g} cm",
            "dropouts": f"{lidar.dropout_share * 100:g} %",
            "trim": f"{math.degrees(vehicle.trim_rad):+.1f}°",
            "delay": f"{vehicle.steering_delay_s * 1000:g} ms",
            "dirt": "on" if lidar.dirty_sectors else "off",
            "own parts": own_parts_of(lidar),
        }

    def answer(self, payload: bytes) -> bytes:
        """Answer a page: {} requests the list of actions, {"do": NAME} performs one; RefusedError with the remedy."""
        try:
            question = json.loads(payload or b"{}")
            name = question.get("do")
        except (ValueError, AttributeError):
            raise RefusedError('ask {} or {"do": "box"}') from None
        if name is not None:
            if name not in self._actions:
                raise RefusedError(f"there is no {str(name)[:20]}; there are {', '.join(self._actions)}")
            self.do(name)
        actions = [{"name": action.name, "words": action.words} for action in ACTIONS]
        return topics.encode({"actions": actions, "conditions": self.fields(), "done": self.done})

    def _steps(
        self, name: str, ladder: tuple[float, ...], now: Callable[[], float], take: Callable[[float], None]
    ) -> dict[str, Callable[[], None]]:
        """Return the two actions that select the next lower and the next higher value."""

        def down() -> None:
            take(max((value for value in ladder if value < now() - 1e-9), default=now()))

        def up() -> None:
            take(min((value for value in ladder if value > now() + 1e-9), default=now()))

        return {f"{name}_down": down, f"{name}_up": up}

    def _vehicle_fields(self, *names: str) -> Callable[[float], None]:
        def take(value: float) -> None:
            self._vehicle.change(self._vehicle.settings.model_copy(update=dict.fromkeys(names, value)))

        return take

    def _lidar_field(self, name: str) -> Callable[[float], None]:
        return lambda value: self._take_lidar(**{name: value})

    def _take_lidar(self, **fields: object) -> None:
        self._surface.lidar = self._surface.lidar.model_copy(update=fields)

    def _toggle_dirt(self) -> None:
        self._take_lidar(dirty_sectors=() if self._surface.lidar.dirty_sectors else self._dirt)

    def _next_parts(self) -> None:
        kinds = own_parts_kinds()
        following = kinds[(kinds.index(own_parts_of(self._surface.lidar)) + 1) % len(kinds)]
        self._take_lidar(**own_parts_fields(following))

    def _person(self) -> None:
        """Return a person who walks from the right to the left, square to the car's present heading."""
        car = self._vehicle.pose
        begin = car.ahead(LIDAR_AHEAD_M + PERSON_AHEAD_M, -PERSON_ASIDE_M)
        left_rad = car.yaw_rad + math.pi / 2
        walks = ConstantMotion(PERSON_MPS * math.cos(left_rad), PERSON_MPS * math.sin(left_rad))
        self._surface.put(Obstacle(Round(0.2), StandingObstacle(begin), walks))
