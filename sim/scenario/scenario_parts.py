"""Parts of a scenario's file, each a table: start, walls, obstacles, faults, expectations."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from wallride.drivers.section import Section
from wallride.sim.scenario.obstacle_text import BOX_M, RADIUS_M
from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, Round, StandingObstacle, SuddenObstacle
from wallride.sim.world.pose import Floats, Pose
from wallride.sim.world.segments import chain

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Place = tuple[Number, Number]
MIN_WALL_M = 0.01
CONDITIONS = (
    "contact", "stands", "stands_within_s", "drives_within_s", "mean_error_below_m", "max_error_below_m",
    "clearance_above_m", "speed_below_mps", "mean_speed_above_mps", "way_above_m", "laps_at_least", "lap_below_s",
    "reason",
)  # fmt: skip
"""What an expectation can be about."""


OF_FAULT: Mapping[str, tuple[str, ...]] = {
    "lidar covered": ("from_deg", "to_deg"), "slippery floor": ("grip_mu",), "noisy lidar": ("noise_m",),
}  # fmt: skip
"""Keys of the faults besides their times."""


class ScenarioStart(Section):
    """Start of the car. at: x, y [m] and heading [rad], or distance_m from the followed wall, turned towards it."""

    at: tuple[Number, Number, Number] | None = None
    distance_m: Positive | None = None
    toward_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if self.at is not None and (self.distance_m is not None or self.toward_deg):
            raise ValueError("give either at, or distance_m and toward_deg")
        return self


class ScenarioWall(Section):
    """A wall through points [m], back to the first one where it is closed."""

    points: Annotated[list[Place], Field(min_length=2)]
    closed: bool = False

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        ring = [*self.points, self.points[0]] if self.closed else self.points
        for (x0, y0), (x1, y1) in pairwise(ring):
            if math.hypot(x1 - x0, y1 - y0) < MIN_WALL_M:
                raise ValueError(f"the wall from {x0:g}, {y0:g} to {x1:g}, {y1:g} has no length")
        return self

    def segments_m(self) -> Floats:
        """Return the wall as segments, (n, 4)."""
        return chain(self.points, closed=self.closed)


class ScenarioObstacle(Section):
    """An obstacle at a place, or before the car at a moment; it moves where moves_mps is given.

    at: x, y [m] and, for a box, heading [rad]. ahead_m: its near face before the lidar; left_m of the car's middle.
    after_s: when it appears, or begins to move; car_speed_mps: it appears when the car is this fast. size_m: length
    and width.
    """

    kind: Literal["box", "pole", "person"]
    at: tuple[Number, Number] | tuple[Number, Number, Number] | None = None
    ahead_m: Positive | None = None
    left_m: Number = 0.0
    after_s: NotNegative | None = None
    until_s: Positive | None = None
    car_speed_mps: NotNegative = 0.0
    size_m: tuple[Positive, Positive] | None = None
    radius_m: Positive | None = None
    moves_mps: Place | None = None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.at is None) == (self.ahead_m is None):
            raise ValueError("say where it is, with at = [x, y] or with ahead_m")
        if self.at is not None and (self.car_speed_mps or self.left_m):
            raise ValueError("left_m and car_speed_mps go with ahead_m; a place is at = [x, y]")
        if self.kind != "box" and self.at is not None and len(self.at) > len(("x", "y")):
            raise ValueError(f"a {self.kind} is round: at = [x, y] has no heading")
        if self.kind == "box" and self.radius_m is not None:
            raise ValueError("a box has size_m = [length, width], no radius_m")
        if self.kind != "box" and self.size_m is not None:
            raise ValueError(f"a {self.kind} has radius_m, no size_m")
        if self.until_s is not None and self.moves_mps is None:
            raise ValueError("until_s ends a motion; give moves_mps = [x, y] too")
        if self.until_s is not None and self.until_s <= (self.after_s or 0.0):
            raise ValueError("until_s must be later than after_s")
        return self

    def obstacle(self) -> Obstacle:
        """Return the obstacle of the simulator."""
        from_s = -math.inf if self.after_s is None else self.after_s
        radius_m = self.radius_m or RADIUS_M.get(self.kind, 0.0)
        shape = Box(*(self.size_m or BOX_M)) if self.kind == "box" else Round(radius_m)
        appearance: StandingObstacle | SuddenObstacle
        if self.at is not None:
            appears_s = from_s if self.moves_mps is None else -math.inf
            appearance = StandingObstacle(Pose(self.at[0], self.at[1], *(self.at[2:] or (0.0,))), appears_s)
        else:
            assert self.ahead_m is not None  # noqa: S101 - one of them is given
            appearance = SuddenObstacle(self.ahead_m, self.left_m, self.car_speed_mps, from_s)
        until_s = math.inf if self.until_s is None else self.until_s
        motion = None if self.moves_mps is None else ConstantMotion(*self.moves_mps, from_s, until_s)
        return Obstacle(shape, appearance, motion)


class ScenarioFault(Section):
    """A fault for a while; without until_s to the end.

    lidar lost, motor lost: the cable is pulled. lidar covered: nothing returns from from_deg to to_deg. slippery
    floor: grip_mu. noisy lidar: noise_m, the standard deviation of each distance.
    """

    kind: Literal["lidar lost", "motor lost", "lidar covered", "slippery floor", "noisy lidar"]
    after_s: NotNegative
    until_s: Positive | None = None
    from_deg: Annotated[float, Field(ge=-180, le=180)] = -60.0
    to_deg: Annotated[float, Field(ge=-180, le=180)] = 60.0
    grip_mu: Annotated[float, Field(gt=0, le=2)] = 0.3
    noise_m: Annotated[float, Field(ge=0, le=1)] = 0.05

    @model_validator(mode="after")
    def _lasts(self) -> Self:
        if self.until_s is not None and self.until_s <= self.after_s:
            raise ValueError("until_s must be later than after_s")
        own = OF_FAULT.get(self.kind, ())
        foreign = sorted(self.model_fields_set - {"kind", "after_s", "until_s", *own})
        if foreign:
            raise ValueError(f"{foreign[0]} is nothing of '{self.kind}', which has {', '.join(own) or 'times only'}")
        if self.from_deg >= self.to_deg:
            raise ValueError("from_deg must be below to_deg: degrees count to the left")
        return self


class ScenarioExpectation(Section):
    """One condition (the first key of CONDITIONS that is given), between two times of the drive."""

    after_s: NotNegative = 0.0
    until_s: Positive | None = None
    contact: bool | None = None
    stands: bool | None = None
    stands_within_s: Positive | None = None
    drives_within_s: Positive | None = None
    mean_error_below_m: Positive | None = None
    max_error_below_m: Positive | None = None
    clearance_above_m: NotNegative | None = None
    speed_below_mps: Positive | None = None
    mean_speed_above_mps: NotNegative | None = None
    way_above_m: NotNegative | None = None
    laps_at_least: Annotated[int, Field(ge=1)] | None = None
    lap_below_s: Positive | None = None
    reason: Annotated[str, Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> Self:
        given = [name for name in CONDITIONS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of {', '.join(CONDITIONS)}" + (f", not {' and '.join(given)}" if given else ""))
        if self.until_s is not None and self.until_s <= self.after_s:
            raise ValueError("until_s must be later than after_s")
        return self

    @property
    def condition(self) -> str:
        """Return the name of its condition."""
        return next(name for name in CONDITIONS if getattr(self, name) is not None)
