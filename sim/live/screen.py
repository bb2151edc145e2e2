"""The live view of a drive: `terminal_view` refreshed on a rich screen while the session runs."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.live import Live

from wallride.runtime.host.address_file import Address
from wallride.runtime.settings.session import SessionSettings
from wallride.runtime.wire.endpoints import split_endpoint
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.live_conditions import LiveConditions
from wallride.sim.live.live_keys import legend
from wallride.sim.live.record import Record
from wallride.sim.live.terminal_view import ViewStatus, page, render_world, status_rows, world_size

LIDAR_X_M = 0.27
MAX_RANGE_MM = 30_000
SLOW_START_S = 3.0
DEFAULT_LISTEN = SessionSettings().listen[0]
NOWHERE = np.empty((0, 4))


class LiveView:
    """Displays the runtime's perception and status; never affects the drive itself.

    outline_m: gives walls and obstacles as segments (n, 4); None for a recording, whose world is unknown: the view
    then follows the car. live: conditions changed by the keys, None without such.
    """

    def __init__(
        self, console: Console, outline_m: Callable[[], npt.NDArray[np.float64]] | None, vehicle: Vehicle,
        live: LiveConditions | None = None,
    ) -> None:  # fmt: skip
        self._console = console
        self._changes = live
        self._outline_m = outline_m
        self._vehicle = vehicle
        self._live = Live(console=console, screen=True, auto_refresh=False)

    def start(self) -> None:
        """Take over the terminal."""
        self._live.start()

    def stop(self) -> None:
        """Give the terminal back."""
        self._live.stop()

    def show(self, record: Record) -> None:
        """Draw the newest state."""
        rows = status_rows(self._status(record))
        if self._changes is not None:
            rows += legend(self._changes.fields())
        width, height = self._console.size
        pose = self._vehicle.pose
        world = render_world(
            self._outline_m() if self._outline_m is not None else NOWHERE,
            (pose.x_m, pose.y_m, pose.yaw_rad),
            self._scan_points(record),
            *world_size(width, height, rows),
            follow=self._outline_m is None,
        )
        self._live.update(page(world, rows, width), refresh=True)

    def _status(self, record: Record) -> ViewStatus:
        said = record.telemetry.get("status", {})
        output = said.get("output") or {}
        error = record.telemetry.get("distance_error", {})
        return ViewStatus(
            time_s=record.time_s,
            speed_mps=self._vehicle.speed_mps,
            steering_rad=output.get("steering_rad"),
            distance_error_m=error.get("error_m"),
            winner=output.get("winner", ""),
            reason=output.get("reason", "") or starting(record),
            lidar=said.get("lidar", {}).get("message", ""),
            motor=said.get("motor", {}).get("message", ""),
            race=lap_words((said.get("pose") or {}).get("race") or {}),
            page=address_in(record.page),
            port=port_notice(record.address, record.listen),
            operate=operate_hint(record.address).partition(": ")[2],
        )

    def _scan_points(self, record: Record) -> npt.NDArray[np.float64] | None:
        if record.ranges_mm is None:
            return None
        ranges_m = np.where(record.ranges_mm <= MAX_RANGE_MM, record.ranges_mm, np.nan) / 1000.0
        lidar = self._vehicle.pose.ahead(LIDAR_X_M)
        beams = len(ranges_m)
        bearing_rad = lidar.yaw_rad + (np.arange(beams) - beams // 2) * math.radians(0.25)
        return np.column_stack([lidar.x_m + ranges_m * np.cos(bearing_rad), lidar.y_m + ranges_m * np.sin(bearing_rad)])


def lap_words(race: Mapping[str, Any]) -> str:
    """Return the lap of a race and how the last one was, "" where no line is driven."""
    if not race:
        return ""
    now = f"lap {race['laps'] + 1}"
    if not math.isfinite(math.nan if (began_s := race.get("began_s")) is None else began_s):
        now = f"not on the line yet; {now} follows"
    if not race["laps"]:
        return now
    times = f"the last one {race['time_s']:.2f} s, the best {race['best_s']:.2f} s"
    return f"{now}; {times}; {100 * race['rms_m']:.1f} cm from the line (rms)"


def starting(record: Record) -> str:
    """Return the current step of a start that takes long, "" for an ordinary one."""
    if record.address is not None or record.starting_s < SLOW_START_S:
        return ""
    return "the car is starting"


def port_notice(address: Address | None, listen: Sequence[str]) -> str:
    """Return the sentence for a car that did not get the first port it was to have, "" for one that did."""
    if address is None or not address.endpoint or not listen or address.endpoint in listen:
        return ""
    port = split_endpoint(listen[0])[2]
    return (
        f"port {port} is taken by another car or program; this one is at {address.endpoint}:"
        f" without --connect {address.endpoint} a command reaches the other"
    )


def operate_hint(address: Address | None) -> str:
    """Return the command for another terminal that operates this very car, "" while it is not known."""
    if address is None or not address.endpoint:
        return ""
    there = "" if address.endpoint == DEFAULT_LISTEN else f" --connect {address.endpoint}"
    return f"in another terminal: wallride teleop{there} --session {address.session} · wallride status --watch{there}"


def address_in(lines: Iterable[str]) -> str:
    """Return the first web address that a program printed, "" before it did."""
    return next((word for line in lines for word in line.split() if word.startswith("http")), "")
