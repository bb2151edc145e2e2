"""What a car's computer says of itself (`on_car.sh facts`), as values. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

RootAccess = Literal["yes", "sudo", "password", "no"]
OLDEST_PYTHON: Final = (3, 11)


class DeployError(Exception):
    """Nothing was changed on the car; the text is one line with the remedy."""


@dataclass(frozen=True, slots=True)
class CarPython:
    """A Python on the car that can make a virtual environment. version: (major, minor, micro)."""

    version: tuple[int, int, int]
    path: str

    @property
    def words(self) -> str:
        """Return its name for a person."""
        return f"{self.path} ({'.'.join(map(str, self.version))})"


@dataclass(frozen=True, slots=True)
class InstalledVersion:
    """A version in the car's folder of versions. note: what it was built from."""

    path: str
    note: str


@dataclass(frozen=True, slots=True)
class CarFacts:
    """The car's computer. machine: as of `uname -m`. glibc: (2, N), None for another C library.

    root: how commands become root's. in_use, before: folders of versions, "" without one.
    service: systemd's ActiveState, "" where it is not installed. state: the driving state of the car that runs there,
    "" where none answers. busy: another installation is going on. free_*_kb: free disk space [KiB].
    """

    machine: str
    glibc: tuple[int, int] | None
    pythons: Sequence[CarPython]
    root: RootAccess
    in_use: str
    before: str
    versions: Sequence[InstalledVersion]
    service: str
    state: str
    busy: bool
    free_versions_kb: int
    free_copies_kb: int
    has_compiler: bool
    missing_tools: Sequence[str]

    def note(self, path: str) -> str:
        """Return what a version was built from, "" where that is not known."""
        return next((version.note for version in self.versions if version.path == path), "")


def read_facts(text: str) -> CarFacts:
    """Return the facts in the script's output; DeployError for an output that is cut off or no such output."""
    lines = [line.partition("=")[::2] for line in text.splitlines()]
    one = dict(lines)
    try:
        one["end"]  # the last line
        return CarFacts(
            machine=one["machine"],
            glibc=read_glibc(one["libc"]),
            pythons=[_python(value) for key, value in lines if key == "python"],
            root=_root(one["root"]),
            in_use=one.get("in_use", ""),
            before=one["before"],
            versions=[InstalledVersion(*_two(value)) for key, value in lines if key == "version"],
            service=one.get("service", ""),
            state=one.get("state", ""),
            busy=one.get("busy") == "yes",
            free_versions_kb=int(one["free_versions_kb"]),
            free_copies_kb=int(one["free_copies_kb"]),
            has_compiler=bool(one["compiler"]),
            missing_tools=[value for key, value in lines if key == "missing"],
        )
    except (KeyError, ValueError):
        said = text.strip().splitlines()[-1] if text.strip() else "nothing"
        raise DeployError(f"the car's computer gave no usable answer (its last line: {said}); is it a Linux?") from None


def _two(value: str) -> tuple[str, str]:
    first, _, rest = value.partition(" ")
    return first, rest


def read_glibc(words: str) -> tuple[int, int] | None:
    """Return the version in the words of `getconf GNU_LIBC_VERSION`; None for another C library."""
    library, _, version = words.partition(" ")
    if library != "glibc":
        return None
    major, minor = version.split(".")[:2]
    return int(major), int(minor)


def _python(value: str) -> CarPython:
    version, path = _two(value)
    major, minor, micro = (int(part) for part in version.split("."))
    return CarPython((major, minor, micro), path)


def _root(value: str) -> RootAccess:
    match value:
        case "yes" | "sudo" | "password" | "no":
            return value
        case _:
            raise ValueError
