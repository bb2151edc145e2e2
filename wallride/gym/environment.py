"""The emulated car in a world, one step a scan (25 ms), in virtual time.

The agent takes the place of laws and safety: nothing brakes for it. Between its drive and the wheels are the car's own
limiter, the time from scan to wire, and the delays of servo and motor; its scan has the noise of a UST-10LX.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast, get_args

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from PIL import Image, ImageDraw

from wallride.drivers.api import MotorState
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.scenario.conditions import checked_conditions
from wallride.sim.scenario.obstacle_text import read_obstacle
from wallride.sim.scenario.scenario_file import MAX_START_TO_WALL_M
from wallride.sim.virtual.closed_loop import RANGE_MAX_M
from wallride.sim.virtual.twin_world import TwinWorld, WorldMotor
from wallride.sim.world.lap import LapCounter
from wallride.sim.world.pose import CAR, Floats, Pose, Side
from wallride.sim.world.worlds import load_world

Observation = dict[str, npt.NDArray[np.float32]]
LATENCY_S = 0.02
CONTACT_REWARD = -10.0
START_SHIFT_M, START_TURN_RAD = 0.2, math.radians(10)
MAX_ODOMETRY = 1e4
POSE_NUMBERS = 3
NUMBERS = "fiu"
"""Kinds of numpy's types that are real numbers."""
_SEEDS = 2**31
SIZE_PX = 480
VIEW_M = 16.0
_PAPER, _WALL, _WAY, _SCAN, _CAR = "white", "#404040", "#1f77b4", "#d62728", "#ff7f0e"


class WallFollowEnv(gymnasium.Env[Observation, npt.NDArray[np.float32]]):
    """Follow a wall at a distance, as far as possible.

    Action (2,): speed [m/s] and steering [rad, left positive], within the car's limits.
    Observation: "scan" (beams,), ranges from right to left [m], RANGE_MAX_M without a return; "odometry" (5,): x, y
        [m], yaw [rad] since the start as the wheels tell, speed [m/s], steering [rad].
    Reward: metres driven forward, less the share of them that the distance error is of the wanted distance; -10 for a
        contact, which ends an episode. After `duration_s` it is truncated.
    Info: time_s, pose (x, y, yaw of the rear axle), wall_m, error_m, laps, contact_mps: the simulator's truth.

    world, obstacles: as of `wallride sim`. conditions: vehicle and lidar, by their names. varies: each episode begins
    up to 20 cm and 10 degrees off the world's start. render_mode: "rgb_array" for pictures by `render`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 40}  # noqa: RUF012 - as gymnasium has it

    def __init__(
        self, world: str = "loop", *, side: Side = "left", desired_distance_m: float = 1.0, duration_s: float = 60.0,
        obstacles: Sequence[str] = (), varies: bool = True, render_mode: str | None = None,
        **conditions: Mapping[str, Any] | None,
    ) -> None:  # fmt: skip
        if render_mode not in {None, *self.metadata["render_modes"]}:
            raise ValueError(f'render_mode {render_mode!r}: it is None or "rgb_array"')
        if side not in get_args(Side):
            raise ValueError(f'side {side!r}: it is "left" or "right"')
        for name, value in (("desired_distance_m", desired_distance_m), ("duration_s", duration_s)):
            if not 0 < value < math.inf:  # NaN is no number
                raise ValueError(f"{name} {value}: it must be a positive number")
        self.render_mode = render_mode
        self._world = load_world(world, side=side)
        self._side, self._desired_m, self._duration_s, self._varies = side, desired_distance_m, duration_s, varies
        if unknown := conditions.keys() - {"vehicle", "lidar"}:
            raise TypeError(f"unknown: {', '.join(sorted(unknown))}; conditions are vehicle and lidar")
        found = checked_conditions({name: given for name, given in conditions.items() if given is not None})
        self._vehicle, self._lidar = found.vehicle, found.lidar
        self._obstacles = tuple(read_obstacle(text) for text in obstacles)
        self._period_s = 1.0 / self._lidar.rate_hz
        car = self._car = CarSettings()
        low, high = [-car.max_reverse_mps, -car.max_steering_rad], [car.max_speed_mps, car.max_steering_rad]
        self._low, self._high = np.array(low, np.float32), np.array(high, np.float32)
        self.action_space = spaces.Box(self._low, self._high, dtype=np.float32)
        seen: dict[str, spaces.Space[Any]] = {
            "scan": spaces.Box(0.0, RANGE_MAX_M, (self._lidar.beams,), np.float32),
            "odometry": spaces.Box(-MAX_ODOMETRY, MAX_ODOMETRY, (5,), np.float32),
        }
        self.observation_space = cast("spaces.Space[Observation]", spaces.Dict(seen))
        self._now_s = 0.0
        self._closed = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode. options: {"start": (x, y, yaw)} puts the rear axle there."""
        self._check_open("reset")
        super().reset(seed=seed)
        self._now_s = 0.0
        if unknown := (options or {}).keys() - {"start"}:
            raise ValueError(f'options {", ".join(map(repr, sorted(unknown, key=repr)))}: only "start" is known')
        self._twin = TwinWorld(
            self._world, self._time_s, start=self._start((options or {}).get("start")), vehicle=self._vehicle,
            lidar=self._lidar, obstacles=self._obstacles, seed=int(self.np_random.integers(_SEEDS)),
        )  # fmt: skip
        self._motor = WorldMotor(self._twin, self._time_s)
        self._limiter = Limiter(self._car)
        self._counter = LapCounter(self._world.lap) if self._world.lap is not None else None
        self._laps = 0.0
        self._odometry = np.zeros(5)
        self._last = self._state()
        self._way: list[tuple[float, float]] = []
        return self._observation(), self._info()

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send a drive, and return what the next scan shows; ValueError for one that is not two finite numbers."""
        self._check_begun("step")
        asked = np.asarray(action)
        if asked.shape != (2,) or asked.dtype.kind not in NUMBERS or not np.isfinite(asked).all():
            raise ValueError(f"action {action!r}: it must be two finite numbers, speed [m/s] and steering [rad]")
        speed_mps, steering_rad = (float(value) for value in np.clip(asked, self._low, self._high))
        told = self._limiter.limit(speed_mps, steering_rad, self._period_s)
        ends_s = self._now_s + self._period_s
        self._now_s += LATENCY_S
        self._motor.send(told)
        self._now_s = ends_s
        before_m = self._last.distance_m
        observation = self._observation()
        info = self._info()
        forward_m = self._last.distance_m - before_m
        reward = forward_m * (1.0 - min(1.0, abs(info["error_m"]) / self._desired_m))
        contact = self._twin.contact_mps is not None
        over = self._now_s > self._duration_s - self._period_s / 2
        return observation, reward + CONTACT_REWARD * contact, contact, over, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return a picture of the car in its world, (height, width, 3); None without a render_mode."""
        if self.render_mode is None:
            return None
        self._check_begun("render")

        pose, lidar = self._twin.vehicle.pose, self._lidar
        place = pose.ahead(lidar.mount_x_m, lidar.mount_y_m)
        angle_rad = np.radians(np.linspace(lidar.first_deg, lidar.last_deg, lidar.beams))
        angle_rad += pose.yaw_rad + lidar.mount_yaw_rad
        seen = self._ranges_m < RANGE_MAX_M
        points_m = np.stack((np.cos(angle_rad), np.sin(angle_rad)), axis=1) * self._ranges_m.astype(float)[:, None]
        segments_m = np.vstack([self._world.outline_m, self._twin.scene.obstacle_outline_m])
        return picture(pose, segments_m, points_m[seen] + (place.x_m, place.y_m), self._way)

    def close(self) -> None:
        """End the environment; harmless when it is closed."""
        self._closed = True
        super().close()

    def _time_s(self) -> float:
        return self._now_s

    def _check_open(self, call: str) -> None:
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError(f"{call} after close: make a new environment")

    def _check_begun(self, call: str) -> None:
        self._check_open(call)
        if not hasattr(self, "_twin"):
            raise gymnasium.error.ResetNeeded(f"{call} before reset: call reset first")

    def _start(self, asked: Sequence[float] | None) -> Pose:
        """Return the start of an episode; ValueError for one in a wall, or where no wall is."""
        if asked is not None:
            numbers = np.asarray(asked)
            if numbers.shape != (POSE_NUMBERS,) or numbers.dtype.kind not in NUMBERS:
                raise ValueError(f"start {asked}: it must be three numbers, x [m], y [m] and yaw [rad]")
            pose = Pose(*numbers.astype(float).tolist())
            if not self._world.clearance(pose) <= MAX_START_TO_WALL_M:  # NaN is nowhere
                raise ValueError(f"the car would start outside {self._world.name}: {pose}")
            if self._world.collides(pose):
                raise ValueError(f"the car would start in a wall of {self._world.name}: {pose}")
            return pose
        start = self._world.start
        if not self._varies:
            return start
        aside_m, turned_rad = self.np_random.uniform(-1, 1, 2) * (START_SHIFT_M, START_TURN_RAD)
        shifted = start.ahead(0.0, float(aside_m))
        pose = Pose(shifted.x_m, shifted.y_m, start.yaw_rad + float(turned_rad))
        return start if self._world.collides(pose) else pose

    def _state(self) -> MotorState:
        """Return the motor controller's report."""
        state = self._motor.state
        assert state is not None  # noqa: S101 - its cable is never pulled here
        return state

    def _observation(self) -> Observation:
        ranges_m = self._twin.ranges_at(self._now_s)
        state = self._state()
        moved_m = state.distance_m - self._last.distance_m
        turned_rad = moved_m * math.tan(state.steering_rad) / self._car.wheelbase_m
        x_m, y_m, yaw_rad = self._odometry[:3]
        middle_rad = yaw_rad + turned_rad / 2
        self._odometry[:] = (
            x_m + moved_m * math.cos(middle_rad), y_m + moved_m * math.sin(middle_rad), yaw_rad + turned_rad,
            state.speed_mps, state.steering_rad,
        )  # fmt: skip
        self._last = state
        self._ranges_m = np.nan_to_num(ranges_m, nan=RANGE_MAX_M)
        return {"scan": self._ranges_m.copy(), "odometry": self._odometry.astype(np.float32)}

    def _info(self) -> dict[str, Any]:
        pose = self._twin.vehicle.pose
        self._way.append((pose.x_m, pose.y_m))
        wall_m = self._world.wall_distance_m(pose, self._side)
        if self._counter is not None:
            self._laps = self._counter.update(pose.x_m, pose.y_m)
        return {
            "time_s": self._now_s,
            "pose": (pose.x_m, pose.y_m, pose.yaw_rad),
            "wall_m": wall_m,
            "error_m": wall_m - self._desired_m,
            "laps": self._laps,
            "contact_mps": self._twin.contact_mps,
        }


def picture(
    pose: Pose, segments_m: Floats, points_m: Floats, way: Sequence[tuple[float, float]]
) -> npt.NDArray[np.uint8]:
    """Return (SIZE_PX, SIZE_PX, 3) bytes, red, green, blue: VIEW_M of the world, the car in the middle.

    segments_m: of walls and obstacles, (n, 4). points_m: of the scan in the world, (n, 2). way: places so far.
    """
    image = Image.new("RGB", (SIZE_PX, SIZE_PX), _PAPER)
    draw = ImageDraw.Draw(image)
    ends = _pixels(pose, segments_m.reshape(-1, 2)).reshape(-1, 4)
    seen = (np.minimum(ends[:, :2], ends[:, 2:]) < SIZE_PX) & (np.maximum(ends[:, :2], ends[:, 2:]) >= 0)
    for line in ends[seen.all(axis=1)].tolist():
        draw.line(line, fill=_WALL, width=2)
    if len(way) > 1:
        draw.line(_pixels(pose, np.array(way)).ravel().tolist(), fill=_WAY, width=2)
    draw.point(_pixels(pose, points_m).ravel().tolist(), fill=_SCAN)
    corners = [pose.ahead(forward_m, left_m) for forward_m, left_m in CAR.corners()]
    draw.polygon(_pixels(pose, np.array([(at.x_m, at.y_m) for at in corners])).ravel().tolist(), outline=_CAR, width=2)
    return np.array(image)


def _pixels(middle: Pose, places_m: Floats) -> Floats:
    """Return places in the world, (n, 2), as columns and rows of the picture."""
    return SIZE_PX / 2 + (places_m - (middle.x_m, middle.y_m)) * (SIZE_PX / VIEW_M) * (1.0, -1.0)
