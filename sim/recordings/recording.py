"""Data model of a recording: one lidar's scans exactly as recorded, and the commands and odometry of the same drive."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wallride.runtime.wire import topics

Floats = npt.NDArray[np.float64]

NAVIGATION_TOPICS = ("vesc_high_level_input_nav_0", "vesc_low_level_input_navigation", "drive", topics.NAVIGATION)
"""Topics of the autonomous program: those of the RACECAR's two muxes, the convention of F1TENTH, wallride's."""
OUTPUT_TOPICS = ("vesc_low_level_ackermann_cmd", "vesc_ackermann_cmd", "ackermann_cmd", topics.OUTPUT)
"""Topics of the last mux's output to the motor."""
SAFETY_TOPICS = ("vesc_low_level_input_safety", "vesc_input_safety", topics.SAFETY)
"""Topics of the safety controller's override."""

OF_OTHERS = ("safety", "teleop", "joy", "manual", "estop", "low_level_ackermann", "output")
"""Words in the names of topics of a human, a safety rule or the last mux."""
LIKELY = ("nav", "high_level", "auto", "drive", "input")
"""Words in the names of topics of autonomous programs, the most significant first."""


MAX_TEXT = 800
NO_RETURN_MM = 65533
"""Value that a UST-10LX sends for a beam without echo; its driver records it as 65.533 m."""
SCIP_MAX_MM = 0o777777
"""Largest distance in SCIP's three-character encoding: 18 bits, 262143."""


class RecordingError(ValueError):
    """A file that cannot be played back; the text is one sentence with the file, the reason, and the remedy."""

    def __init__(self, text: str) -> None:
        """Keep the beginning and the end of a long text: readers quote whole damaged pieces of a file."""
        plain = "".join(letter if letter.isprintable() else " " for letter in text)
        super().__init__(plain if len(plain) <= MAX_TEXT else f"{plain[: MAX_TEXT // 2]} ... {plain[-MAX_TEXT // 4 :]}")


@dataclass(frozen=True, slots=True, eq=False)
class CommandTrack:
    """Drive commands of one topic over time.

    received_s: shape (n,), on the recording's zero; negative for commands before the first scan.
    speed_mps, steering_rad: shape (n,), as requested; forward and left are positive.
    """

    received_s: Floats
    speed_mps: Floats
    steering_rad: Floats

    def __len__(self) -> int:
        """Return the number of commands."""
        return len(self.received_s)


@dataclass(frozen=True, slots=True, eq=False)
class OdometryTrack:
    """Poses in the odometry frame and velocities in the car's frame over time; all of shape (n,).

    received_s: on the recording's zero; negative before the first scan.
    """

    received_s: Floats
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    vx_mps: Floats
    vy_mps: Floats
    wz_radps: Floats

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.received_s)


@dataclass(frozen=True, slots=True, eq=False)
class LidarTrack:
    """All scans of one lidar topic; times are seconds since 1970 in a reader, the rest is as in `Recording`."""

    topic: str
    received_s: Floats
    stamp_s: Floats
    ranges_m: npt.NDArray[np.float32]
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float
    scan_time_s: float

    @property
    def beams(self) -> int:
        """Return the number of beams of every scan."""
        return int(self.ranges_m.shape[1])

    @property
    def sweep_s(self) -> float:
        """Return the time from the first beam to the last."""
        return self.ray_s * (self.beams - 1)

    @property
    def ray_s(self) -> float:
        """Return the time from one beam to the next, of a sensor that turns evenly."""
        return self.scan_time_s * abs(self.angle_step_rad) / math.tau


@dataclass(frozen=True, slots=True, eq=False)
class Recording(LidarTrack):
    """One lidar's scans, and the other messages of the drive. All arrays are read-only.

    received_s: shape (n,), when the recorder received each scan; starts at 0 and never falls.
    stamp_s: shape (n,), of the first beams, on the same zero. They may jump: clocks differ between publishers.
    ranges_m: shape (n, beams), float32, untouched: 65.533, 0, inf and NaN all occur for "no return".
    angle_min_rad, angle_step_rad: beam k points to angle_min + k * step, counter-clockwise, 0 = ahead; see `fan`.
    range_min_m, range_max_m: as the driver declared them; recorded ranges may exceed them.
    scan_time_s: of a turn, as the driver declared it; 0 where all beams are as seen at stamp_s.
    topic: the lidar's topic as recorded; other_topics: further lidars of the file, selectable by name.
    commands: by topic, written without slashes (`plain_name`).
    notes: sentences for the user about what was chosen, left out or lost.
    """

    name: str
    other_topics: tuple[str, ...]
    commands: Mapping[str, CommandTrack]
    odometry: OdometryTrack | None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of scans."""
        return len(self.received_s)

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last scan received."""
        return float(self.received_s[-1])

    @property
    def navigation(self) -> CommandTrack | None:
        """Return the requests of the autonomous program; None when they were not recorded.

        Teams name their topics freely: of those with another name the most likely one, by its name, else the fullest.
        """
        return self._first_of(NAVIGATION_TOPICS) or self._likely_navigation()

    @property
    def output(self) -> CommandTrack | None:
        """Return the low-level mux's output; None when it was not recorded."""
        return self._first_of(OUTPUT_TOPICS)

    @property
    def safety(self) -> CommandTrack | None:
        """Return the safety controller's demands; None when they were not recorded or there were none."""
        return self._first_of(SAFETY_TOPICS)

    def _likely_navigation(self) -> CommandTrack | None:
        others = {
            topic: track for topic, track in self.commands.items()
            if topic not in OUTPUT_TOPICS and topic not in SAFETY_TOPICS and len(track)
            and not any(word in topic.lower() for word in OF_OTHERS)
        }  # fmt: skip
        for word in LIKELY:
            if named := {topic: track for topic, track in others.items() if word in topic.lower()}:
                others = named
                break
        return max(others.items(), key=lambda item: (len(item[1]), item[0]))[1] if others else None

    def _first_of(self, topics: tuple[str, ...]) -> CommandTrack | None:
        return next((self.commands[topic] for topic in topics if topic in self.commands), None)


def plain_name(topic: str) -> str:
    """Return a topic's name without slashes, as the .npz archives write it: `/vesc/odom` becomes `vesc_odom`."""
    return topic.strip("/").replace("/", "_")


def to_sensor_mm(
    ranges_m: npt.NDArray[np.floating], range_min_m: float = 0.0, range_max_m: float = 0.0
) -> npt.NDArray[np.int32]:
    """Return the integers that the sensor must have sent, in millimetres; same shape as given.

    ranges_m: as recorded. Finite values are rounded to the nearest millimetre, whatever the limits say: 65.533
        becomes 65533 again, 0 stays 0 and 0.006 the error code 6.
    range_min_m, range_max_m: the sensor's limits, as recorded. They only choose a code for NaN and infinity,
        such that the receiver must reject it: +inf and NaN become NO_RETURN_MM, or SCIP_MAX_MM for a sensor that
        sees that far; -inf (REP-117: too close) becomes 0, or as NaN where a distance of 0 would be valid.

    Results are clipped to the range of SCIP, 0 to SCIP_MAX_MM.
    """
    no_return_mm = NO_RETURN_MM if range_max_m * 1000 < NO_RETURN_MM else SCIP_MAX_MM
    too_near_mm = 0 if range_min_m > 0 else no_return_mm
    millimetres = np.rint(np.asarray(ranges_m, dtype=np.float64) * 1000)
    known: npt.NDArray[np.float64] = np.nan_to_num(
        millimetres, nan=no_return_mm, posinf=no_return_mm, neginf=too_near_mm
    )
    return np.clip(known, 0, SCIP_MAX_MM).astype(np.int32)
