"""What a page is told of a map of a car's lap, and where recording, map and settings are. Without an event loop."""

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from wallride.clients.monitor.command_run import CommandAnswer, CommandFailedError
from wallride.clients.race_along import IDENTITY
from wallride.runtime.recording.ring import parse
from wallride.runtime.settings.recording import recordings_folder
from wallride.runtime.wire.network import RefusedError

MAPS: Final = "maps"
"""Folder of maps, beside the car's settings file, else beside the recordings."""
OF_THE_LINE: Final = ("car.wheelbase_m", "car.max_steering_rad", "car.max_acceleration_mps2", "car.half_width_m")
"""Settings of the car that its race line depends on."""
ASKED: Final = tuple(dict.fromkeys((*IDENTITY, *OF_THE_LINE)))
"""Settings that the car is asked for."""
ON_THE_CAR: Final = "/var/lib/wallride"
"""Where a map from another computer is to be put on a car."""
MAX_PICTURE_B: Final = 16 << 20

Stage = Literal["none", "asking", "fetching", "mapping", "line", "good", "refused", "failed", "saving", "saved"]


@dataclass(frozen=True, slots=True)
class LapMap:
    """A map of a lap, from the press of the button on.

    words: sentences on it, the most important first. refusal: why it was not raced along. pictures: by name.
    number: counts the maps, so that a browser shows no older picture. map: its file, once it is good. file: the car's
    settings, where they can be written here. lines: what to do by hand where they cannot. fastest_mps: of the line, 0.0
    without one.
    """

    car: str = ""
    stage: Stage = "none"
    recording: str = ""
    words: tuple[str, ...] = ()
    refusal: str = ""
    pictures: Mapping[str, Path] = field(default_factory=dict)
    number: int = 0
    map: Path | None = None
    file: Path | None = None
    lines: str = ""
    fastest_mps: float = 0.0

    @property
    def can_be_raced(self) -> bool:
        """Return whether it is good, has a line, and the car's settings can be written here."""
        return self.stage == "good" and self.fastest_mps > 0.0 and self.file is not None

    def fields(self) -> dict[str, Any]:
        """Return plain values for a page."""
        return {
            "car": self.car, "stage": self.stage, "recording": self.recording,
            "words": [*filter(None, [self.refusal]), *self.words], "is_refused": bool(self.refusal),
            "pictures": list(self.pictures), "number": self.number, "lines": self.lines,
            "can_be_raced": self.can_be_raced, "file": str(self.file or ""), "fastest_mps": self.fastest_mps,
        }  # fmt: skip

    def picture(self, name: str) -> bytes | None:
        """Return a picture as PNG, None where there is none of that name."""
        path = self.pictures.get(name)
        if path is None:
            return None
        try:
            with path.open("rb") as file:
                return file.read(MAX_PICTURE_B)
        except OSError:
            return None


def newest_drive(listed: Mapping[str, Any], car: str) -> tuple[Path, str, int]:
    """Return folder, name and size [B] of a car's newest recording that is no black box. RefusedError without one."""
    try:
        drives = [one for one in listed["files"] if not one["black_box"]]
        if not drives:
            raise RefusedError(f"{car} has no recording yet: drive a lap along the wall, then let it stand")
        folder, name, size_bytes = Path(str(listed["folder"])), str(drives[-1]["name"]), int(drives[-1]["size_bytes"])
    except (KeyError, TypeError, ValueError):
        raise RefusedError(f"{car}: its list of recordings cannot be read: is another version on it?") from None
    if parse(name) is None:  # a car must not choose the place of files on this computer
        raise RefusedError(f"{car} offers {name!r}, which is not the name of a recording")
    return folder, name, size_bytes


def recording_here(folder: Path, name: str, size_bytes: int) -> Path | None:
    """Return the recording where this computer is the car's, or has its folder; None where it has to be fetched."""
    path = folder / name
    try:
        is_it = path.stat().st_size >= size_bytes and os.access(path, os.R_OK)
    except OSError:
        return None
    return path if is_it else None


def maps_folder(file: Path | None) -> Path:
    """Return the folder of maps. file: the car's settings, where they are on this computer: the car reads its map."""
    return (file.absolute().parent if file is not None else recordings_folder("").parent) / MAPS


def map_told(answer: CommandAnswer) -> Mapping[str, Any]:
    """Return the figures of `wallride map`. CommandFailedError where it made no map."""
    try:
        told = json.loads(answer.out) if answer.code in {0, 1} else None
        if isinstance(told, dict) and isinstance(told["reasons"], list):
            return told
    except (KeyError, ValueError):
        pass
    raise CommandFailedError(f"No map was made: {answer.reason}")


def map_words(told: Mapping[str, Any], recording: str) -> tuple[str, ...]:
    """Return the verdict in a sentence, and what it rests on."""
    about = f"{recording}: {told['way_m']:.1f} m of way in {told['keyframes']} places"
    if told["reasons"]:
        refused = f"The map is refused: {'; '.join(map(str, told['reasons']))}."
        return (refused, f"{about}. docs/racing.md says what each reason asks for.")
    if told["loops"]:
        about += f"; {told['loops']} edges close the loop, {told['full_loops']} of them in all directions"
    apart = f"the scans lie {1000 * told['residual_m']:.0f} mm beside each other (rms)"
    return ("The map is good.", f"{about}; {apart}.")


def line_told(answer: CommandAnswer) -> tuple[str, float]:
    """Return the race line in a sentence, and its highest speed [m/s]; 0.0 where there is none, with the reason."""
    try:
        told = json.loads(answer.out) if not answer.code else None
        if isinstance(told, dict):
            speeds = f"{told['slowest_mps']:.1f} to {told['fastest_mps']:.1f} m/s"
            about = f"The race line: {told['length_m']:.1f} m, {told['lap_s']:.2f} s a lap in theory, {speeds}."
            return about, float(told["fastest_mps"])
    except (KeyError, ValueError, TypeError):
        pass
    return f"There is no race line: {answer.reason}", 0.0


def way_to_race(made: LapMap, told: Mapping[str, Any], *, is_here: bool) -> tuple[str, str]:
    """Return what to do where the monitor does not write the settings: a sentence, and lines to copy."""
    file = made.map
    if file is None:
        return "", ""
    if told.get("recording.simulated"):
        return (
            "A simulated car races along it by this command:",
            f"wallride sim --race {shlex.quote(str(file))} --laps 5",
        )
    place = str(file) if is_here else f"{ON_THE_CAR}/{file.name}"
    copied = "" if is_here else f"Copy {file.with_suffix('')}.* to {ON_THE_CAR} on the car. "
    lines = f'[map]\nfile = "{place}"\n\n[wall_follow]\nmethod = "line"'
    words = "Put these lines into the car's settings file and restart the car"
    return f"{copied}{words}; a monitor on the car's computer that was started with --config FILE writes them.", lines
