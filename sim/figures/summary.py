"""Figures of a run, from the simulator's own truth: the car's real motion, not its estimate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.control.score import STANDING_BELOW_MPS
from sim.world.pose import Floats

SETTLE_BAND_M = 0.05
SETTLED_FOR_S = 2.0
ON_THE_LINE_M = 0.02
STANDING_FOR_S = 1.0


@dataclass(frozen=True, slots=True)
class Sample:
    """State of the car at a moment. wall_m: true distance from the rear axle to the followed wall, inf without one."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    wall_m: float
    clearance_m: float


def figures(samples: Sequence[Sample], desired_m: float | Floats) -> dict[str, Any]:
    """Return duration, distance, errors, settling, clearance and speed of a run.

    desired_m: the wanted distance, one for all samples or one for each.

    Errors count while the car moves, over samples that have a wall. `settle_s` is the time after which the error
    first stays within 5 cm for 2 s; a later corner does not count. It is null when it never does.
    """
    table = np.array([[s.time_s, s.x_m, s.y_m, s.speed_mps, s.wall_m, s.clearance_m] for s in samples]).reshape(-1, 6)
    time_s, x_m, y_m, speed_mps, wall_m, clearance_m = table.T
    moving = np.abs(speed_mps) > STANDING_BELOW_MPS
    counted = np.isfinite(wall_m) & moving
    error_m = wall_m[counted] - np.broadcast_to(desired_m, wall_m.shape)[counted]
    distance_m = float(np.hypot(np.diff(x_m), np.diff(y_m)).sum())
    moving_s = float(np.diff(time_s, append=time_s[-1:])[moving].sum()) if moving.any() else 0.0
    return {
        "duration_s": _number(time_s[-1] - time_s[0] if len(table) else 0.0),
        "distance_m": _number(distance_m),
        "mean_abs_error_m": _number(np.abs(error_m).mean()) if error_m.size else None,
        "rms_error_m": _number(np.sqrt((error_m**2).mean())) if error_m.size else None,
        "settle_s": _settle_s(time_s[counted], error_m),
        "max_overshoot_m": _overshoot_m(error_m),
        "min_clearance_m": _number(clearance_m.min()) if len(table) else None,
        "stopped": _stands_at_the_end(time_s, speed_mps),
        "mean_speed_mps": _number(distance_m / moving_s) if moving_s > 0 else 0.0,
    }


def _number(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None


def _settle_s(time_s: Floats, error_m: Floats) -> float | None:
    since_s: float | None = None
    for now_s, now_m in zip(time_s, error_m, strict=True):
        if abs(now_m) > SETTLE_BAND_M:
            since_s = None
            continue
        since_s = now_s if since_s is None else since_s
        if now_s - since_s >= SETTLED_FOR_S:
            return _number(since_s - time_s[0])
    return None


def _overshoot_m(error_m: Floats) -> float | None:
    """Return the overshoot past the desired distance, seen from the side on which the car started.

    A car that starts on the line has no side: for it every departure counts.
    """
    if not error_m.size:
        return None
    if abs(error_m[0]) < ON_THE_LINE_M:
        return _number(np.abs(error_m).max())
    past_m = -error_m if error_m[0] > 0 else error_m
    return _number(max(0.0, float(past_m.max())))


def _stands_at_the_end(time_s: Floats, speed_mps: Floats) -> bool:
    if not time_s.size:
        return True
    last = time_s > time_s[-1] - STANDING_FOR_S
    return bool((np.abs(speed_mps[last]) < STANDING_BELOW_MPS).all())


def device_faults(status: Mapping[str, Any]) -> dict[str, int]:
    """Return every kind of fault that the devices counted, by name: `lidar.checksum`, `motor.reconnect`."""
    faults = {}
    for device in ("lidar", "motor"):
        for what, times in status.get(device, {}).get("counts", {}).items():
            if times:
                faults[f"{device}.{what}"] = times
    if status.get("fault"):
        faults[f"motor: {status['fault']}"] = 1
    return faults
