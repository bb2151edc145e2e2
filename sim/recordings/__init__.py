"""Readers of recordings, whose values are returned exactly. Read `recording`, `loading`, `archive`, `ros`, `tracks`."""

from wallride.sim.recordings.loading import load_recording
from wallride.sim.recordings.recording import (
    NO_RETURN_MM,
    CommandTrack,
    OdometryTrack,
    Recording,
    RecordingError,
    to_sensor_mm,
)

__all__ = [
    "NO_RETURN_MM",
    "CommandTrack",
    "OdometryTrack",
    "Recording",
    "RecordingError",
    "load_recording",
    "to_sensor_mm",
]
