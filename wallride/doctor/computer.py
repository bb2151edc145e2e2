"""The computer as the checks see it. Tests give a folder for its file system, and answers for the rest."""

import getpass
import grp
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from wallride.runtime.recording.disk import Disk
from wallride.runtime.wire.ports import is_taken

REALTIME_PRIORITY: Final = 20


@dataclass(frozen=True, slots=True)
class Computer:
    """root: of its file system. devices: below which the serial ports lie; both "/" on a real computer.

    user, groups: names. may_use: may this user read and write the file. free_bytes: of the disk of a folder.
    realtime_refusal: why this process may not have SCHED_FIFO, "" when it may. port_is_free: for host and port.
    has_module: whether a Python package is installed. now_unix_s: the civil time.
    """

    root: Path
    devices: Path
    user: str
    groups: frozenset[str]
    now_unix_s: float
    may_use: Callable[[Path], bool]
    free_bytes: Callable[[Path], int]
    realtime_refusal: Callable[[], str]
    port_is_free: Callable[[str, int], bool]
    has_module: Callable[[str], bool]

    def path(self, name: str) -> Path:
        """Return a file of its file system."""
        return self.root / name.lstrip("/")

    def device(self, name: str) -> Path:
        """Return a serial port."""
        return self.devices / name.lstrip("/")

    def text(self, name: str) -> str:
        """Return the contents of a small file without white space at its ends, "" where it cannot be read."""
        return read(self.path(name))

    def processes(self) -> Iterator[tuple[int, str]]:
        """Yield number and name of every process that may be seen."""
        for folder in sorted(self.path("/proc").glob("[0-9]*")):
            if name := read(folder / "comm"):
                yield int(folder.name), name

    def holders(self, device: Path) -> list[tuple[int, str]]:
        """Return the processes that have a device open; without root only those of this user are seen."""
        found = []
        for pid, name in self.processes():
            if pid != os.getpid() and any(target == str(device) for target in self._open_files(pid)):
                found.append((pid, name))
        return found

    def command(self, pid: int) -> list[str]:
        """Return the words of a process's command line, none where they may not be seen."""
        return read(self.path(f"/proc/{pid}/cmdline")).split("\0")

    def _open_files(self, pid: int) -> Iterator[str]:
        try:
            for link in self.path(f"/proc/{pid}/fd").iterdir():
                yield str(link.readlink())
        except OSError:  # another user's process, or one that has ended meanwhile
            return


def read(path: Path) -> str:
    """Return the contents of a small file, stripped; "" where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def this_computer() -> Computer:
    """Return the computer on which this runs."""
    groups = set()
    for number in os.getgroups():
        try:
            groups.add(grp.getgrgid(number).gr_name)
        except KeyError:
            continue
    root = Path("/")
    return Computer(
        root, root, getpass.getuser(), frozenset(groups), time.time(), _may_use, Disk().free_bytes, _realtime_refusal,
        _port_is_free, lambda name: find_spec(name) is not None,
    )  # fmt: skip


def _may_use(path: Path) -> bool:
    return os.access(path, os.R_OK | os.W_OK)


def _realtime_refusal() -> str:
    """Ask for SCHED_FIFO in a thread that ends with it."""
    refusal: list[str] = []

    def ask() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REALTIME_PRIORITY))
        except OSError as error:
            refusal.append(error.strerror or str(error))

    asking = threading.Thread(target=ask)
    asking.start()
    asking.join()
    return "".join(refusal)


def _port_is_free(host: str, port: int) -> bool:
    return not is_taken(f"tcp/{host}:{port}")
