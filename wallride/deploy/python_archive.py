"""A Python for the car that comes along as a file: an archive of python-build-standalone, judged by its name. Pure."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from wallride.deploy.facts import OLDEST_PYTHON, CarPython, DeployError

SUFFIX: Final = ".tar.gz"
FOLDER: Final = "/opt/wallride-versions/python"
NAME: Final = re.compile(
    r"cpython-(\d+)\.(\d+)\.(\d+)\+\d+-(\w+)-unknown-linux-gnu-install_only(?:_stripped)?\.tar\.gz"
)


@dataclass(frozen=True, slots=True)
class PythonArchive:
    """An archive on this computer. machine: as of `uname -m`. version: (major, minor, micro)."""

    file: Path
    machine: str
    version: tuple[int, int, int]

    @property
    def folder(self) -> str:
        """Return where install.sh unpacks it on the car."""
        return f"{FOLDER}/{self.file.name.removesuffix(SUFFIX)}"

    @property
    def python(self) -> CarPython:
        """Return the Python that it becomes there."""
        return CarPython(self.version, f"{self.folder}/bin/python3")


def read_archive(file: Path) -> PythonArchive:
    """Return what the name of an archive says; DeployError for another file."""
    if not file.is_file():
        raise DeployError(f"{file}: is not there")
    found = NAME.fullmatch(file.name)
    if found is None:
        raise DeployError(
            f"{file}: is no archive of python-build-standalone for Linux:"
            " cpython-3.12.N+DATE-MACHINE-unknown-linux-gnu-install_only.tar.gz"
        )
    major, minor, micro = (int(number) for number in found.group(1, 2, 3))
    if (major, minor) < OLDEST_PYTHON:
        raise DeployError(f"{file}: is Python {major}.{minor}, and 3.11 or newer is needed")
    return PythonArchive(file, found[4], (major, minor, micro))
