"""Recordings of real lidars, read for playback. What was recorded is handed on exactly; nothing is cleaned here.

Read in this order: `recording` (what a recording is), `loading` (`load_recording`, the front door), then the two
readers `archive` (.npz) and `ros` with `messages` (.bag, .db3, .mcap through the package `rosbags`), `tracks` (what
both deliver and how a recording is put together from it), `salvage` and `salvage_ros2` (damaged files), and
`sensor_units` (back to the integers that the sensor sent).
"""

from sim.recordings.loading import load_recording
from sim.recordings.recording import CommandTrack, OdometryTrack, Recording, RecordingError
from sim.recordings.sensor_units import NO_RETURN_MM, to_sensor_mm

__all__ = [
    "NO_RETURN_MM",
    "CommandTrack",
    "OdometryTrack",
    "Recording",
    "RecordingError",
    "load_recording",
    "to_sensor_mm",
]
