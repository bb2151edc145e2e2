"""Writes settings into the car's file: the user's comments and order survive, and so does the file, whatever happens.

A new file is written beside the old one, forced to the disk, checked by loading it, and renamed over it; rename is
atomic, so a power cut leaves the old file or the new one. Everything here blocks: call it in a thread.
"""

import os
import stat
from collections.abc import Callable, Mapping, MutableMapping
from pathlib import Path
from typing import Any

from runtime.parameters import Value, shown, values
from runtime.settings import SettingsError, load_settings

_NEW_FILE_MODE = 0o644


class StoreError(Exception):
    """Nothing was saved, and the file is what it was, unless the text says otherwise."""


def save(path: Path, edits: Mapping[str, Value | None], expected: Mapping[str, Value]) -> None:
    """Write edits (None removes a key) into a settings file, then see that it loads to the expected values.

    What somebody else wrote into the file since the start stays. Raises StoreError.
    """
    path = Path(os.path.realpath(path))  # a link to the file stays a link
    try:
        text = path.read_bytes().decode()
        before = path.stat()
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{path}: cannot be read: {_why(error)}") from None
    content = merged(text, edits, path)

    def is_good(written: Path) -> None:
        _check(written, expected, path)
        if _moment(path.stat()) != _moment(before):
            raise StoreError(f"{path}: somebody else changed it just now; nothing was saved, try again")

    replace(path, content.encode(), like=before, check=is_good)


def merged(text: str, edits: Mapping[str, Value | None], path: Path) -> str:
    """Return a TOML text with some values changed and everything else as it was."""
    import tomlkit  # slow to import, and only needed here
    from tomlkit.exceptions import TOMLKitError

    try:
        document = tomlkit.parse(text)
        for name, value in edits.items():
            *sections, key = name.split(".")
            if value is None:
                _remove(document, sections, key)
            else:
                _section(document, sections, tomlkit.table)[key] = value
        return tomlkit.dumps(document)
    except (TOMLKitError, TypeError, ValueError) as error:
        raise StoreError(f"{path}: is not TOML that can be edited: {error}; nothing was saved") from None


def replace(
    path: Path, content: bytes, *, like: os.stat_result | None = None, check: Callable[[Path], None] | None = None
) -> None:
    """Put content in the place of a file, wholly or not at all.

    like: whose mode and owner the new file gets. check: may refuse the written file by raising. Raises StoreError.
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
        raise StoreError(f"{path}: not saved, the old file is untouched: {_why(error)}") from None
    try:
        _force_to_disk(path.parent)
    except OSError as error:
        raise StoreError(f"{path}: saved, but a power cut now may bring the old file back: {_why(error)}") from None


def _write(path: Path, content: bytes, like: os.stat_result | None) -> None:
    path.unlink(missing_ok=True)  # what an earlier power cut left behind
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


def _check(written: Path, expected: Mapping[str, Value], path: Path) -> None:
    """Refuse a file that would not start the car again, or not with these values."""
    try:
        found = values(load_settings(written))
    except SettingsError as error:
        raise StoreError(f"{str(error).replace(str(written), str(path))}; nothing was saved") from None
    for name, value in expected.items():
        if found.get(name) != value:
            raise StoreError(
                f"{path}: would say {name} = {shown(found.get(name))} where {shown(value)} is wanted; nothing was saved"
            )


def _section(document: Any, sections: list[str], new_table: Callable[[], Any]) -> MutableMapping[str, Any]:  # noqa: ANN401 - tomlkit's containers share no type
    """Return the table of a section, made where it is missing."""
    for section in sections:
        if section not in document:
            document[section] = new_table()
        document = document[section]
    return document  # type: ignore[no-any-return]


def _remove(document: Any, sections: list[str], key: str) -> None:  # noqa: ANN401 - as above
    """Remove a key, and the sections that are empty without it."""
    chain = [document]
    for section in sections:
        if section not in chain[-1]:
            return
        chain.append(chain[-1][section])
    for table, name in zip(reversed(chain), [key, *reversed(sections)], strict=True):
        if name in table and (name == key or not table[name]):
            del table[name]


def _moment(status: os.stat_result) -> tuple[int, int, int]:
    return status.st_ino, status.st_size, status.st_mtime_ns


def _why(error: Exception) -> str:
    if isinstance(error, PermissionError):
        return f"{error.strerror}; the car's user must own the file and be able to write into its folder"
    return str(error.strerror) if isinstance(error, OSError) and error.strerror else str(error)
