"""Comparison of a recorded drive with ours: the runtime's steering beside the recorded navigation command, per scan."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallride.sim.recordings.recording import CommandTrack
from wallride.sim.world.pose import Floats

CLEAR_TURN_RAD = 0.05
"""Minimum steering of the recorded car at which its sign is significant."""
MAX_WAIT_S = 0.15
DROVE_ABOVE_MPS = 0.1


@dataclass(frozen=True, slots=True)
class ComparedSteering:
    """Both answers to one scan [rad, positive left]."""

    time_s: float
    ours_rad: float
    recorded_rad: float


def recorded_answers(
    scans_s: Sequence[float], track: CommandTrack, max_steering_rad: float = math.inf
) -> list[float | None]:
    """Return, for each scan, the first command received after it, None if it came too late to be an answer.

    max_steering_rad: limit of the wheels; programs request more, and the linkage does not reach it.
    """
    positions = np.searchsorted(track.received_s, np.asarray(scans_s), side="left")
    answers: list[float | None] = []
    for scan_s, position in zip(scans_s, positions, strict=True):
        late = position >= len(track) or track.received_s[position] - scan_s > MAX_WAIT_S
        asked_rad = math.nan if late else float(track.steering_rad[position])
        answers.append(None if late else min(max(asked_rad, -max_steering_rad), max_steering_rad))
    return answers


def drove(scans_s: Sequence[float], output: CommandTrack | None) -> list[bool]:
    """Return, for each scan, whether the recorded mux let the car move: the steering of a held car has no meaning.

    Without a recorded output nothing is known, and every scan counts.
    """
    if output is None or not len(output):
        return [True] * len(scans_s)
    newest = np.searchsorted(output.received_s, np.asarray(scans_s), side="right") - 1
    return [bool(index >= 0 and abs(output.speed_mps[index]) > DROVE_ABOVE_MPS) for index in newest]


def compare(pairs: Sequence[ComparedSteering]) -> dict[str, Any]:
    """Return the agreement of the two: sign where the recorded car clearly turned, size, correlation, slope.

    slope: radians of ours per radian recorded (total least squares, so that neither counts as the truth).
    """
    if not pairs:
        return {"compared_scans": 0}
    ours = np.array([pair.ours_rad for pair in pairs])
    recorded = np.array([pair.recorded_rad for pair in pairs])
    clear = np.abs(recorded) > CLEAR_TURN_RAD
    varied = ours.std() > 0 and recorded.std() > 0
    return {
        "compared_scans": len(pairs),
        "clear_turns": int(clear.sum()),
        "same_sign_share": round(float((ours[clear] * recorded[clear] > 0).mean()), 3) if clear.any() else None,
        "median_difference_rad": round(float(np.median(ours - recorded)), 4),
        "median_abs_difference_rad": round(float(np.median(np.abs(ours - recorded))), 4),
        "correlation": round(float(np.corrcoef(ours, recorded)[0, 1]), 3) if varied else None,
        "slope": round(_slope(recorded, ours), 3) if varied else None,
        "mean_ours_rad": round(float(ours.mean()), 4),
        "mean_recorded_rad": round(float(recorded.mean()), 4),
        "rms_ours_rad": round(float(np.sqrt((ours**2).mean())), 4),
        "rms_recorded_rad": round(float(np.sqrt((recorded**2).mean())), 4),
    }


def _slope(x: Floats, y: Floats) -> float:
    """Return the slope of the line nearest to the points, measured at right angles to it."""
    covariance = np.cov(x, y)
    angle_rad = 0.5 * np.arctan2(2 * covariance[0, 1], covariance[0, 0] - covariance[1, 1])
    return float(np.tan(angle_rad))
