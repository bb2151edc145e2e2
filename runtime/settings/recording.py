"""Settings of the recorder: content, folder, and share of the disk."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.section import Section

FOLDER = "wallride/recordings"
SIMULATED = "simulated"


class RecordingSettings(Section):
    """The [recording] section."""

    enabled: bool = True
    """Record drives; false: no recordings and no black box."""

    start: Literal["armed", "always", "request"] = "armed"
    """armed: while the car is armed or moves. always: from the start of the process, best for replays. request: on
    `wallride record start` only."""

    folder: str = ""
    """Folder of recordings; empty: a folder named after the car in the service's state directory, else in
    ~/.local/share/wallride/recordings."""

    simulated: bool = False
    """Simulated car: recordings in a folder of their own. Set by `wallride sim`."""

    world: str = ""
    """Simulated world, shown with the recording; empty on a real car. Set by `wallride sim`."""

    ring_mb: Annotated[int, Field(ge=16)] = 4096
    """Maximum size of all recordings of a car; the oldest are deleted. An hour of driving is about 1 GB."""

    keep_free_mb: Annotated[int, Field(ge=0)] = 512
    """Minimum free space of the disk; recordings are deleted to keep it, where that is enough."""

    file_mb: Annotated[int, Field(ge=8, le=4096)] = 256
    """Maximum size of a file, at most a quarter of `ring_mb`; a longer recording continues in another one."""

    black_box_s: Annotated[float, Field(ge=0, le=120)] = 30.0
    """Length of the black box, the time before a stop that is kept in memory; 0: no black box."""

    after_s: Annotated[float, Field(ge=1, le=600)] = 10.0
    """Time of standing disarmed after which a recording ends."""

    raw: bool = False
    """Record the bytes from and to the lidar and the motor controller as well."""


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
