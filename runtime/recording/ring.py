"""The folder of recordings as a ring: file names, their order, and the deletion of old files for new ones.

    20261121T084600Z-b0007-00042.mcap                      a recording
    20261121T084655Z-b0007-00043-stop-braking-wall-ahead.mcap   a black box: the half minute before that stop

The last number counts the files of this folder and defines their age, because a car without a battery-backed clock may
report the year 1970; b counts the starts of the computer. A file without its end (`recover`) has the same name.
"""

import contextlib
import errno
import json
import logging
import os
import re
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from wallride.runtime.recording.disk import Disk, is_being_written
from wallride.runtime.settings.recording import RecordingSettings

log = logging.getLogger("wallride.recording")

MB = 1_000_000
NAME = re.compile(r"(\d{8}T\d{6}Z)-b(\d{4,})-(\d{5,})(-stop(?:-([a-z0-9-]{1,48}))?)?\.mcap")
COUNTS = "counts.json"
"""File of the counts of files and starts, so that a number is not reused after its file was deleted."""
KEPT = "kept"
"""Folder beside a ring whose files the ring never deletes."""
ENDING = ".mcap"
DEEPEST = 3
"""Maximum depth of folders below the one of all recordings: simulated/CAR/kept."""
FILE_SHARE = 0.25
"""Largest share of the ring for one recording: the ring deletes whole files."""
BLACK_BOX_SHARE = 0.25
"""Share of the ring up to which black boxes are deleted last."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One file of the folder. number: defines its age. reason: of a black box, "" for a recording."""

    name: str
    number: int
    size_bytes: int
    is_black_box: bool
    reason: str


def parse(name: str) -> tuple[int, bool, str] | None:
    """Return number, whether it is a black box, and its reason; None for the name of another file."""
    found = NAME.fullmatch(name)
    return (int(found[3]), found[4] is not None, found[5] or "") if found is not None else None


def entries(folder: Path) -> list[Entry]:
    """Return the recordings in a folder, oldest first; other files are ignored."""
    try:
        return sorted(_entries(folder), key=lambda entry: entry.number)
    except (FileNotFoundError, NotADirectoryError):
        return []


def folders(above: Path, deepest: int = DEEPEST) -> list[Path]:
    """Return the folder and those below it that hold recordings or cannot be read, in the order of their names."""
    try:
        found = [above] if entries(above) else []
        below = sorted(entry.name for entry in os.scandir(above) if deepest and entry.is_dir(follow_symlinks=False))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError:
        return [above]
    return found + [folder for name in below for folder in folders(above / name, deepest - 1)]


def keep(path: Path) -> Path:
    """Move a recording out of its ring; return its new path.

    OSError without permission, or while it is being written.
    """
    if path.parent.name == KEPT:
        return path
    if is_being_written(path):
        raise OSError(errno.EBUSY, "is being written; keep it when the drive is over")
    target = path.parent / KEPT / path.name
    target.parent.mkdir(exist_ok=True)
    path.rename(target)
    return target


def file_named(path: Path, above: Path) -> Path | None:
    """Return the file at a path, or the one that `wallride logs` lists by that path or bare name; None without one.

    The ending .mcap may be left out.
    """
    names = [path, *([path.with_name(f"{path.name}{ENDING}")] if path.name and path.suffix != ENDING else [])]
    if path.is_absolute():
        return next(filter(_is_file, names), None)
    places = [Path(), above, *(folders(above) if path.name == str(path) else ())]
    return next((place / name for place in places for name in names if _is_file(place / name)), None)


def newest_recording(above: Path) -> Path | None:
    """Return the recording in a folder or below it that was written last, no black box; None without one."""
    found: list[tuple[float, Path]] = []
    for folder in folders(above):
        with contextlib.suppress(OSError):  # a folder, or a file, that went away or may not be read
            runs = [folder / entry.name for entry in entries(folder) if not entry.is_black_box]
            found += [(path.stat().st_mtime, path) for path in runs]
    return max(found, default=(0.0, None))[1]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a folder that may not be entered
        return False


def _entries(folder: Path) -> Iterator[Entry]:
    for path in folder.iterdir():
        known = parse(path.name)
        if known is None or path.is_symlink():
            continue
        try:
            size_bytes = path.stat().st_size
        except FileNotFoundError:  # deleted just now
            continue
        yield Entry(path.name, known[0], size_bytes, *known[1:])


def in_order_of_leaving(present: Sequence[Entry], limit_bytes: int) -> list[Entry]:
    """Return the entries in the order of their deletion, the newest black box last. limit_bytes: of the whole ring."""
    boxes = [entry for entry in present if entry.is_black_box]
    runs = [entry for entry in present if not entry.is_black_box]
    boxes_bytes, too_many = sum(entry.size_bytes for entry in boxes), 0
    while boxes_bytes > BLACK_BOX_SHARE * limit_bytes and too_many < len(boxes) - 1:
        boxes_bytes -= boxes[too_many].size_bytes
        too_many += 1
    return [*boxes[:too_many], *runs, *boxes[too_many:]]


@dataclass(slots=True)
class Trimmed:
    """Names of the recordings that were deleted, and of those that cannot be opened or deleted, with the reason."""

    deleted: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)


def trim(
    folder: Path,
    limit_bytes: int,
    remove: Callable[[Path], None] = Path.unlink,
    missing_bytes: Callable[[], int] = lambda: 0,
    foreign: Container[str] = (),
) -> Trimmed:
    """Delete the oldest files down to the limit, and as long as the disk misses room; OSError for the folder itself.

    Files being written, by this process or another, stay. So do all within the limit where their deletion cannot make
    the room: something else fills the disk. foreign: names that were refused before: not the ring's.
    """
    present = [entry for entry in entries(folder) if entry.name not in foreign]
    total_bytes = sum(entry.size_bytes for entry in present)
    is_short = missing_bytes() > 0
    able = {entry.name: entry.size_bytes for entry in present if is_short and _may_leave(folder / entry.name)}
    makes_room = is_short and missing_bytes() <= sum(able.values())
    trimmed = Trimmed()
    for entry in in_order_of_leaving(present, limit_bytes):
        if total_bytes <= limit_bytes and not (makes_room and missing_bytes() > 0):
            break
        try:
            if is_being_written(folder / entry.name):
                continue
            remove(folder / entry.name)
            trimmed.deleted.append(entry.name)
        except FileNotFoundError:  # by another process just now
            pass
        except OSError as error:
            trimmed.refused[entry.name] = error.strerror or str(error)
            able.pop(entry.name, None)
            makes_room = makes_room and missing_bytes() <= sum(able.values())
        able.pop(entry.name, None)
        total_bytes -= entry.size_bytes
    return trimmed


def _may_leave(path: Path) -> bool:
    try:
        return not is_being_written(path)
    except OSError:  # gone, or another user's
        return False


class Ring:
    """Makes room and names files. Every call may raise OSError."""

    def __init__(self, folder: Path, settings: RecordingSettings, disk: Disk, boot_id: str) -> None:
        self.folder = folder
        self._settings = settings
        self._disk = disk
        self._boot_id = boot_id
        self._number = 0
        self._boot = 0
        self._foreign: set[str] = set()

    def next_path(self, unix_ns: int, reason: str | None = None) -> Path:
        """Return the path of the next file. reason: of a stop, None for a recording."""
        if not self._number:
            self._read_counts()
        self._number += 1
        self._write_counts()
        when = datetime.fromtimestamp(max(unix_ns, 0) / 1e9, UTC).strftime("%Y%m%dT%H%M%SZ")
        stop = "" if reason is None else f"-stop-{slug(reason)}".rstrip("-")
        return self.folder / f"{when}-b{self._boot:04d}-{self._number:05d}{stop}.mcap"

    def make_room(self) -> bool:
        """Delete the oldest files until ring and disk have room, as `trim`; False when the disk has none even so."""
        found = trim(self.folder, self._settings.ring_mb * MB, self._disk.remove, self._missing_bytes, self._foreign)
        for name in found.deleted:
            log.info("%s: deleted for room", name)
        for name, why in found.refused.items():
            log.warning("%s: cannot be deleted for room (%s): the ring leaves it alone", self.folder / name, why)
        self._foreign |= found.refused.keys()
        return self._missing_bytes() <= 0

    def _missing_bytes(self) -> int:
        return self._settings.keep_free_mb * MB - self._disk.free_bytes(self.folder)

    def _read_counts(self) -> None:
        counts = {}
        try:
            counts = json.loads((self.folder / COUNTS).read_text())
            self._number, self._boot = int(counts["files"]), int(counts["boots"])
        except (OSError, ValueError, TypeError, KeyError):
            pass  # none yet, another user's, or torn by a power cut: the files present are sufficient
        present = entries(self.folder)
        self._number = max(self._number, *(entry.number for entry in present), 0) if present else self._number
        if not counts or counts.get("boot_id") != self._boot_id:
            self._boot += 1

    def _write_counts(self) -> None:
        text = json.dumps({"files": self._number, "boots": self._boot, "boot_id": self._boot_id})
        self.folder.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(OSError):  # another user's: as above; of a full disk the recording itself tells
            (self.folder / f".{COUNTS}").write_text(text)
            (self.folder / f".{COUNTS}").replace(self.folder / COUNTS)


def slug(reason: str) -> str:
    """Return a reason as a part of a file's name."""
    return re.sub(r"[^a-z0-9]+", "-", reason.lower()).strip("-")[:40].strip("-")
