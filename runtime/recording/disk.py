"""The disk operations of a recording, in one place, so that tests can inject a faulty disk."""

import contextlib
import errno
import fcntl
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import IO

_MODE = 0o640
_WORDS: Mapping[int, str] = MappingProxyType(
    {
        errno.ENOSPC: "the disk is full",
        errno.EDQUOT: "the disk quota is used up",
        errno.EROFS: "the disk is read-only (its file system may be damaged)",
        errno.EIO: "the disk fails to write (loose or worn-out SD card?)",
        errno.EACCES: "the folder may not be written by the car's user",
        errno.EPERM: "the folder may not be written by the car's user",
        errno.ENOTDIR: "the folder's place is taken by a file",
    }
)


class Disk:
    """The machine's own disk."""

    def create(self, path: Path) -> int:
        """Create a new file, readable by the owner and the group; none is left where that fails."""
        path.parent.mkdir(parents=True, exist_ok=True)
        # Appended to: written at its old end, a file that was truncated would have a hole and its old length.
        how = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        descriptor = os.open(path, how, _MODE)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)  # tells `recover` that it is being written
            self._sync_folder(path.parent)
        except OSError:
            os.close(descriptor)
            self.remove(path)
            raise
        return descriptor

    def _sync_folder(self, path: Path) -> None:
        folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            self.sync(folder)
        finally:
            os.close(folder)

    def write(self, descriptor: int, data: memoryview) -> int:
        """Write some of the data."""
        return os.write(descriptor, data)

    def sync(self, descriptor: int) -> None:
        """Force the data to the disk."""
        os.fdatasync(descriptor)

    def close(self, descriptor: int) -> None:
        """Close the file."""
        os.close(descriptor)

    def remove(self, path: Path) -> None:
        """Delete a file; a missing one is fine."""
        path.unlink(missing_ok=True)

    def discard(self, path: Path) -> None:
        """Delete a file, if that is possible."""
        with contextlib.suppress(OSError):
            self.remove(path)

    def free_bytes(self, folder: Path) -> int:
        """Return the free bytes where the folder is, or will be."""
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        facts = os.statvfs(folder)
        return facts.f_bavail * facts.f_frsize

    def has(self, descriptor: int, path: Path, size_bytes: int) -> bool:
        """Tell whether an open file is still the one at its path, of the length that was written."""
        written = os.fstat(descriptor)
        try:
            there = path.lstat()
        except FileNotFoundError:
            return False
        return os.path.samestat(there, written) and written.st_size == size_bytes


def opened(path: Path, also: int = 0) -> IO[bytes]:
    """Open a recording for reading; OSError for what cannot be read or is no file. also: further flags of the open."""
    waits_not = also | os.O_NONBLOCK  # a pipe would wait
    file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | waits_not))  # noqa: SIM115 - the caller's
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "is no file")
    return file


def is_being_written(path: Path) -> bool:
    """Tell whether some process is writing a recording; OSError when it cannot be opened."""
    with opened(path) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def explain(error: OSError) -> str:
    """Return the meaning of a disk error for the owner of the car."""
    return _WORDS.get(error.errno or 0) or f"the disk refuses: {error.strerror or error}"
