"""Any recording as a log of the car's own topics: ours as it is, another's with the decisions of our laws."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wallride.sim.recordings import load_recording
from wallride.sim.replay.drive_log import DriveLog, is_mcap, read_log
from wallride.sim.replay.foreign import drive_recording, settings_for


@dataclass(frozen=True, slots=True)
class OpenedRecording:
    """An opened recording. ours: whether wallride drove the recorded car."""

    log: DriveLog
    ours: bool


def open_any(path: Path, assignments: Sequence[str] = (), topic: str | None = None) -> OpenedRecording:
    """Return the content of a file; assignments and topic are for recordings of others.

    RecordingError when nothing can be read, SettingsError when an assignment is unusable.
    """
    if path.is_file() and is_mcap(path):
        log = read_log(path)
        if log.is_ours:
            return OpenedRecording(log, ours=True)
    recording = load_recording(path, topic)
    settings, notes = settings_for(recording, assignments)
    return OpenedRecording(drive_recording(recording, settings, notes), ours=False)
