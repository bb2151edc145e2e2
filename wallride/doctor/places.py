"""Files and folders of the settings that would get into each other's way: what one writes, another one is."""

import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from wallride.doctor.ports import serial_paths
from wallride.runtime.recording.own_parts_memory import file_in
from wallride.runtime.settings.recording import car_folder
from wallride.runtime.settings.tree import Settings


def colliding_places(settings: Settings, files: Sequence[Path | None]) -> list[str]:
    """Return a sentence for each place that a program would write over. files: the settings files."""
    written = {name: path.expanduser().resolve() for name, path in _written(settings)}
    others = {f"the settings file {path}": path.resolve() for path in files if path is not None}
    others |= {name: path.resolve() for name, _, path in serial_paths(settings)}
    found = [
        f"{one} and {other} are the same, {written[one]}: name another place"
        for one, other in itertools.combinations([*written, *others], 2)
        if one in written and written[one] == {**written, **others}[other]
    ]
    kept = {name: path.expanduser().resolve() for name, path in _kept(settings)}
    found += [
        f"{one} = {path} is in {other}, in which nothing else is written: name another place"
        for one, path in written.items()
        for other, folder in kept.items()
        if path.is_relative_to(folder)
    ]
    history = settings.parameters.history_path
    if history is not None and not found and not _may_be_history(history):
        found.append(f"parameters.history_file = {history}: is there, and is no history of changes: name another file")
    return found


def _written(settings: Settings) -> Iterator[tuple[str, Path]]:
    yield "recording.folder", car_folder(settings.recording, settings.car.name)
    if (history := settings.parameters.history_path) is not None:
        yield "parameters.history_file", history
    if (parts := file_in(settings.process.state_folder)) is not None:
        yield "the own parts in process.state_folder", parts


def _kept(settings: Settings) -> Iterator[tuple[str, Path]]:
    yield "telemetry.keys_dir", settings.telemetry.keys_dir
    yield "telemetry.connect_keys_dir", settings.telemetry.connect_keys_dir
    yield "joystick.layouts_folder", Path(settings.joystick.layouts_folder)
    if settings.process.laws_folder:
        yield "process.laws_folder", Path(settings.process.laws_folder)


def _may_be_history(path: Path) -> bool:
    """Tell whether a file is absent, empty, or begins as the history that the car writes; it is replaced whole."""
    try:
        with path.open(encoding="utf-8") as file:
            first = file.readline(100_000)
        return not first or "stamp_s" in json.loads(first)
    except FileNotFoundError:
        return True
    except PermissionError:
        return True  # said when it is read
    except (OSError, ValueError, TypeError, RecursionError):
        return False
