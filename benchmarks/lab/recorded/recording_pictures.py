"""Pictures of recorded drives, to check safety's decisions by eye: the scan, the car, its way.

Also the window: every beam's range over the scans. Faults of the window stay on their beams while the car moves.
"""

import math
import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.lab.recorded.episodes import Episode
from benchmarks.lab.recorded.replay import JudgedScan, Replay
from wallride.runtime.control.perception.geometry import bearings_rad
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.world.pose import CAR, Pose

_DPI = 100
_SEEN_M = 3.0
_SHOWN_WAY_M = 1.5
_STEP_M, _LATENCY_S = 0.06, 0.07
_WINDOW_SHOWN_M = 3.0
WINDOW_TITLE_LETTERS, EPISODE_TITLE_LETTERS = 120, 95
"""Maximum number of letters above the pictures, at their sizes."""


def wrapped(title: str, letters: int) -> str:
    """Return a title broken into lines that are not cut at the picture's edge."""
    return "\n".join(part for line in title.split("\n") for part in textwrap.wrap(line, letters))


def save_episode(folder: Path, done: Replay, number: int, episode: Episode) -> Path:
    """Write the picture of one interference; returns its path."""
    judged = done.judged[episode.worst]
    figure = Figure(figsize=(8, 8), layout="constrained")
    axes = figure.subplots()
    _draw_scan(axes, judged)
    _draw_way(axes, judged)
    _draw_really(axes, done, episode.worst)
    kind = "stop" if episode.stop else f"at most {episode.allowed_mps:.2f} m/s"
    axes.set_title(
        wrapped(
            f"{done.recording.name}, scan {episode.worst} ({judged.scan.stamp_s:.2f} s): {kind}\n"
            f"{episode.reason}; way {episode.way_m:.2f} m at {episode.speed_mps:.2f} m/s,"
            f" asked {judged.asked.speed_mps:.2f} m/s, {math.degrees(judged.asked.steering_rad):+.0f}°"
            f" ({judged.asked.origin})\n"
            f"the real car {episode.outcome}: nearest {episode.room_m:.2f} m within a second",
            EPISODE_TITLE_LETTERS,
        ),
        fontsize=10,
    )
    path = folder / f"recordings-{done.recording.name}-{number:02d}-scan{episode.worst}.png"
    figure.savefig(path, dpi=_DPI)
    return path


def save_window(folder: Path, done: Replay) -> Path:
    """Write a picture of all ranges by bearing and scan, with the beams that count as dirty."""
    figure = Figure(figsize=(11, 8), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[5, 1])
    ranges_m = np.array([judged.scan.ranges_m for judged in done.judged])
    at_deg = np.degrees(bearings_rad(done.recording.angle_min_rad, done.recording.angle_step_rad, done.recording.beams))
    image = above.imshow(
        np.minimum(ranges_m, _WINDOW_SHOWN_M),
        aspect="auto",
        cmap="nipy_spectral",
        interpolation="nearest",
        extent=(float(at_deg[0]), float(at_deg[-1]), float(len(ranges_m)), 0.0),
    )
    figure.colorbar(image, ax=above, label=f"range, up to {_WINDOW_SHOWN_M:g} [m]; white: no distance")
    words = "; ".join(done.health.words) or "window clean"
    above.set(ylabel="scan")
    above.set_title(wrapped(f"{done.recording.name}: {words}", WINDOW_TITLE_LETTERS), fontsize=10)
    below.fill_between(at_deg, done.masked, step="mid", color="tab:red")
    below.set(xlabel="bearing [deg], left positive", ylabel="scans masked")
    path = folder / f"recordings-{done.recording.name}-window.png"
    figure.savefig(path, dpi=_DPI)
    return path


def _draw_scan(axes: Axes, judged: JudgedScan) -> None:
    view = judged.assessment.view
    axes.plot(view.x_m[view.solid], view.y_m[view.solid], ".", color="0.15", markersize=4, label="solid")
    rest = ~view.solid & ~view.no_echo
    axes.plot(view.x_m[rest], view.y_m[rest], "x", color="tab:orange", markersize=4, label="ignored")
    axes.fill(*_outline(Pose(0.0, 0.0, 0.0)), facecolor="tab:blue", alpha=0.3, edgecolor="tab:blue", label="car")
    axes.set_xlim(-1.0, _SEEN_M)
    axes.set_ylim(-_SEEN_M / 1.5, _SEEN_M / 1.5)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(visible=True, color="0.9")


def _draw_way(axes: Axes, judged: JudgedScan) -> None:
    """Draw the outlines along the requested way, as far as safety saw it free: with steering rate, without drift."""
    car, motor = CarSettings(), judged.motor
    way_m = judged.verdict.measure if math.isfinite(judged.verdict.measure) else _SHOWN_WAY_M
    speed_mps, wheels_rad, at = max(0.3, motor.speed_mps), motor.steering_rad, Pose(0.0, 0.0, 0.0)
    for step in range(1 + math.ceil(min(way_m, _SHOWN_WAY_M) / _STEP_M)):
        axes.fill(*_outline(at), facecolor="none", edgecolor="tab:red", lw=0.6)
        if step * _STEP_M > speed_mps * _LATENCY_S:
            turn_rad = car.steering_rate_radps * _STEP_M / speed_mps
            wheels_rad += min(max(judged.asked.steering_rad - wheels_rad, -turn_rad), turn_rad)
        turned_rad = math.tan(wheels_rad) / car.wheelbase_m * _STEP_M
        ahead = Pose(at.x_m, at.y_m, at.yaw_rad + turned_rad / 2).ahead(_STEP_M)
        at = Pose(ahead.x_m, ahead.y_m, at.yaw_rad + turned_rad)
    axes.plot([], [], color="tab:red", label="way that safety judged")


def _draw_really(axes: Axes, done: Replay, number: int) -> None:
    """Draw the true way of the car in the next second."""
    motion, begun_s = done.motion, done.judged[number].scan.stamp_s
    later = [n for n in range(number, len(done.judged)) if 0 <= done.judged[n].scan.stamp_s - begun_s <= 1.0]
    cos, sin = math.cos(motion.yaw_rad[number]), math.sin(motion.yaw_rad[number])
    dx, dy = motion.x_m[later] - motion.x_m[number], motion.y_m[later] - motion.y_m[number]
    lidar_m = CarSettings().lidar_x_m
    axes.plot(lidar_m + cos * dx + sin * dy, cos * dy - sin * dx, color="tab:green", lw=2, label="lidar, next second")
    axes.legend(loc="upper right", fontsize=8)


def _outline(pose: Pose) -> tuple[list[float], list[float]]:
    corners = [pose.ahead(forward_m, left_m) for forward_m, left_m in CAR.corners()]
    return [at.x_m for at in corners], [at.y_m for at in corners]
