"""Settings of the recorder: content, folder, and share of the disk."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from runtime.settings_base import Section

FOLDER = "wallride/recordings"
SIMULATED = "simulated"


class RecordingSettings(Section):
    """The [recording] section."""

    enabled: bool = True
    """false: no recording, no black box."""

    start: Literal["armed", "always", "request"] = "armed"
    """armed: whenever the car is armed or moves. always: from the start of the process on, as replays like it best.
    request: only when `wallride record start` asks."""

    folder: str = ""
    """Where; empty is a folder of the car's name in the service's state directory, else in
    ~/.local/share/wallride/recordings."""

    simulated: bool = False
    """A simulated car: its folder, and so its ring, is apart from those of real drives. Set by `wallride sim`."""

    world: str = ""
    """The simulated world, shown with the recording; empty on a real car. Set by `wallride sim`."""

    ring_mb: Annotated[int, Field(ge=16)] = 4096
    """All recordings of a car together; the oldest make room for the new. An hour of driving is about 1 GB."""

    keep_free_mb: Annotated[int, Field(ge=0)] = 512
    """So much of the disk is left to others, whatever the ring may hold."""

    file_mb: Annotated[int, Field(ge=8, le=4096)] = 256
    """A longer recording goes on in another file, so that the ring can let go of its beginning."""

    black_box_s: Annotated[float, Field(ge=0, le=120)] = 30.0
    """How much is kept in memory, for the moments before a stop; 0 is no black box."""

    after_s: Annotated[float, Field(ge=1, le=600)] = 10.0
    """A recording ends when the car has stood disarmed for so long."""

    raw: bool = False
    """Also the very bytes from the lidar and the motor controller, and those sent to them."""


def recordings_folder(configured: str, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of recordings on this machine, for the car and for the commands that read them."""
    if configured:
        return Path(configured).expanduser()
    if state := environment.get("STATE_DIRECTORY", "").split(":")[0]:  # given by systemd
        return Path(state) / "recordings"
    data = environment.get("XDG_DATA_HOME") or "~/.local/share"
    return Path(data).expanduser() / FOLDER


def car_folder(settings: RecordingSettings, car: str, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the recordings folder of one car: its own, so that cars do not delete each other's recordings for room."""
    folder = recordings_folder(settings.folder, environment)
    if settings.folder:
        return folder
    return folder / SIMULATED / car if settings.simulated else folder / car
