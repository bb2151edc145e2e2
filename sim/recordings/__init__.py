"""Readers of recordings of real lidars, for playback. Recorded values are returned exactly; nothing is cleaned here.

Read in this order: `recording` (the data model), `loading` (`load_recording`, the entry point), then the two readers
`archive` (.npz) and `ros` with `messages` (.bag, .db3, .mcap through the package `rosbags`), `tracks` (the output of
both and the assembly of a recording from it), `salvage` and `salvage_ros2` (damaged files), `sensor_units` (back to
the integers that the sensor sent), and `scans` (what the car would have had of them).
"""

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
