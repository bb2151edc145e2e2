"""The car's settings file: an update preserves the user's comments and their order, and never leaves a torn file.

A new file is written beside the old one, forced to the disk, checked by loading it, and renamed over it; rename is
atomic, so a power cut leaves the old file or the new one. Everything here blocks: call it in a thread.
"""

import functools
import operator
import os
import stat
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wallride.runtime.control.method_settings import METHODS
from wallride.runtime.parameters import toml_text
from wallride.runtime.parameters.catalogue import Value, shown, values
from wallride.runtime.parameters.policy import is_safety_relevant
from wallride.runtime.settings.tree import Settings, SettingsError, layered, load_settings, read_tree

_NEW_FILE_MODE = 0o644
MARK = "saved while the car ran"
"""Comment behind a saved value that bounds the car; `marked` finds it, and the next start warns of it."""


class StoreError(Exception):
    """Nothing was saved, and the file is unchanged, unless the text states otherwise."""


def save(
    path: Path, edits: Mapping[str, Value | None], expected: Mapping[str, Value], base: Path | None = None, *,
    origin: str = "",
) -> None:  # fmt: skip
    """Write edits (None removes a key) into a settings file, then check that it loads to the expected values.

    A key whose value holds without this file is not added to it. Edits by other programs since the start stay.
    base: the file below this one, where there is one; then this one holds differences only, and need not exist.
        origin: the comment behind each value. Raises StoreError.
    """
    path = Path(os.path.realpath(path))  # a link to the file stays a link
    text, before = _present(path, base)
    _refuse_another_law(text, edits, expected, path, base)
    known = _unsaid(base, expected)
    content = merged(text, edits, path, known, keep=base is None, origin=origin)

    def is_good(written: Path) -> None:
        _check(written, expected, path, base)
        if _moment(path) != before:
            raise StoreError(f"{path} was changed by another program just now; nothing was saved, try again")

    replace(path, content.encode(), like=path.stat() if before is not None else None, check=is_good)


def merged(
    text: str,
    edits: Mapping[str, Value | None],
    path: Path,
    known: Mapping[str, Value] | None = None,
    *,
    keep: bool = True,
    origin: str = "",
) -> str:
    """Return a TOML text with some values changed and everything else unchanged.

    known: values that need not be written. keep: whether an existing line with such a value stays. origin: a comment
        behind each value, in place of the one there; "": that one stays.
    """
    try:
        tomllib.loads(text)
        for name, value in edits.items():
            place = tuple(name.split("."))
            is_known = value is not None and known is not None and known.get(name) == value
            if value is None or (is_known and not keep):
                text = toml_text.remove(text, place)
            elif not is_known or toml_text.holds(text, place):
                comment = (
                    _with_mark(toml_text.comments(text).get(place, "")) if is_safety_relevant(name) else origin or None
                )
                text = toml_text.set_value(text, place, value, comment)
    except (RecursionError, ValueError) as error:
        raise StoreError(f"{path}: is not TOML that can be edited: {error}; nothing was saved") from None
    return text


def _present(path: Path, base: Path | None) -> tuple[str, tuple[int, int, int] | None]:
    """Return a file's content and its modification stamp; a file of differences may not exist yet."""
    try:
        if base is not None and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            return f"# What `wallride param save` and the page's Save changed, on top of {base.name}.\n\n", None
        return path.read_bytes().decode("utf-8-sig"), _moment(path)
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{path}: cannot be read: {_why(error)}") from None


def _refuse_another_law(
    text: str, edits: Mapping[str, Value | None], expected: Mapping[str, Value], path: Path, base: Path | None
) -> None:
    """Refuse values of a law that the file does not name, because it was selected with --set."""
    try:
        tree = layered(read_tree(base) if base is not None else {}, tomllib.loads(text))
    except (SettingsError, RecursionError, ValueError):
        return  # the merge or the check of the written file reports the error
    for section in METHODS:
        name, values_of = f"{section}.method", tree.get(section)
        said = values_of.get("method") if isinstance(values_of, Mapping) else None
        said = said if said is not None else getattr(Settings(), section).method
        running = expected.get(name)
        if running is not None and name not in edits and said != running:
            raise StoreError(
                f"{path}: its {name} is {said}, and the car drives with {running}: write"
                f' method = "{running}" below [{section}] first, then save; nothing was saved'
            )


def _unsaid(base: Path | None, expected: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return the values that hold without the file: those of the selected laws, and the method itself."""
    try:
        below = load_settings(base)
        methods = {
            section: str(expected.get(f"{section}.method", getattr(below, section).method)) for section in METHODS
        }
        tree = read_tree(base) if base is not None else {}
        laws = layered(tree, {section: {"method": method} for section, method in methods.items()})
        return {
            **values(Settings.model_validate(laws)),
            **{f"{section}.method": getattr(below, section).method for section in METHODS},
        }
    except (SettingsError, ValidationError):
        return {}  # then everything is written, and the check of the written file reports the error


def replace(
    path: Path, content: bytes, *, like: os.stat_result | None = None, check: Callable[[Path], None] | None = None
) -> None:
    """Replace the content of a file, wholly or not at all.

    like: source of the new file's mode and owner. check: may refuse the written file by raising. Raises StoreError.
    """
    written = path.with_name(f".{path.name}.new")
    try:
        try:
            _write(written, content, like)
            if check is not None:
                check(written)
            written.replace(path)
        except BaseException:
            written.unlink(missing_ok=True)
            raise
    except OSError as error:
        kept = ", the old file is untouched" if path.exists() else ""
        raise StoreError(f"{path}: not saved{kept}: {_why(error)}") from None
    try:
        _force_to_disk(path.parent)
    except OSError as error:
        raise StoreError(f"{path}: saved, but a power cut now may bring the old file back: {_why(error)}") from None


def _write(path: Path, content: bytes, like: os.stat_result | None) -> None:
    path.unlink(missing_ok=True)  # left behind by an earlier power cut
    mode = stat.S_IMODE(like.st_mode) if like is not None else _NEW_FILE_MODE
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    try:
        if like is not None and (os.geteuid(), os.fstat(file).st_gid) != (like.st_uid, like.st_gid):
            os.fchown(file, like.st_uid, like.st_gid)
        os.fchmod(file, mode)
        left = memoryview(content)
        while left:
            left = left[os.write(file, left) :]
        os.fsync(file)
    finally:
        os.close(file)


def _force_to_disk(directory: Path) -> None:
    """Make a rename in this directory survive a power cut."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _check(written: Path, expected: Mapping[str, Value], path: Path, base: Path | None) -> None:
    """Refuse a file that would not start the car again, or not with these values."""
    try:
        found = values(load_settings(written) if base is None else load_settings(base, saved=written))
    except SettingsError as error:
        raise StoreError(f"{str(error).replace(str(written), str(path))}; nothing was saved") from None
    for name, value in expected.items():
        if found.get(name) != value:
            raise StoreError(
                f"{path}: would say {name} = {shown(found.get(name))} where {shown(value)} is wanted; nothing was saved"
            )


def _with_mark(said: str) -> str:
    """Return a comment with the one that no person wrote the value into the file, behind what it says already."""
    return said if MARK in said else f"{said}; {MARK}" if said else MARK


def marked(path: Path) -> dict[str, Any]:
    """Return the values of a file that were saved while the car ran and bound it, by dotted name.

    A file that cannot be read has none; loading it says why.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return {}
    try:
        tree = tomllib.loads(text) if MARK in text else {}
    except (RecursionError, ValueError):
        return {}
    said = toml_text.comments(text) if tree else {}
    return {".".join(place): functools.reduce(operator.getitem, place, tree) for place in said if MARK in said[place]}


def _moment(path: Path) -> tuple[int, int, int] | None:
    """Return a stamp that changes whenever a file is written; None while there is no file."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def _why(error: Exception) -> str:
    if isinstance(error, PermissionError):
        return f"{error.strerror}; the car's user must own the file and be able to write into its folder"
    return str(error.strerror) if isinstance(error, OSError) and error.strerror else str(error)
