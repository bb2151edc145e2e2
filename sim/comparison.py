"""A recorded drive against ours: the runtime's steering beside the recorded navigation command, scan by scan."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.recordings.recording import CommandTrack

CLEAR_TURN_RAD = 0.05
"""Where the recorded car steered less than this, its sign says nothing."""
LONGEST_WAIT_S = 0.15


@dataclass(frozen=True, slots=True)
class SteeringPair:
    """Both answers to one scan [rad, positive left]."""

    time_s: float
    ours_rad: float
    recorded_rad: float


def recorded_answers(scans_s: Sequence[float], track: CommandTrack) -> list[float | None]:
    """Return, for each scan, the first command received after it, None where it came too late to be an answer."""
    positions = np.searchsorted(track.received_s, np.asarray(scans_s), side="left")
    answers: list[float | None] = []
    for scan_s, position in zip(scans_s, positions, strict=True):
        late = position >= len(track) or track.received_s[position] - scan_s > LONGEST_WAIT_S
        answers.append(None if late else float(track.steering_rad[position]))
    return answers


def compare(pairs: Sequence[SteeringPair]) -> dict[str, Any]:
    """Return how well the two agree: sign where the recorded car clearly turned, size, correlation."""
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
        "median_abs_difference_rad": round(float(np.median(np.abs(ours - recorded))), 4),
        "correlation": round(float(np.corrcoef(ours, recorded)[0, 1]), 3) if varied else None,
        "mean_ours_rad": round(float(ours.mean()), 4),
        "mean_recorded_rad": round(float(recorded.mean()), 4),
        "rms_ours_rad": round(float(np.sqrt((ours**2).mean())), 4),
        "rms_recorded_rad": round(float(np.sqrt((recorded**2).mean())), 4),
    }
