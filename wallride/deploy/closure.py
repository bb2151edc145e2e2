"""Which wheels a computer needs, from the wheels' own metadata and that computer's platform. Pure.

pip judges the markers of requirements (`python_version < "3.13"`) by the machine on which it runs, also with
`--platform`; here they are judged by the car's.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from email.parser import HeaderParser
from typing import Final

from packaging.requirements import Requirement
from packaging.tags import Tag, compatible_tags, cpython_tags
from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename
from packaging.version import Version

from wallride.deploy.facts import CarPython, DeployError

OLDEST_GLIBC: Final = {"x86_64": 5, "i686": 5}
"""Minor version of glibc 2 from which wheels (manylinux) are named; 17 on every other machine."""
LEGACY: Final = {17: "manylinux2014", 12: "manylinux2010", 5: "manylinux1"}


@dataclass(frozen=True, slots=True)
class CarPlatform:
    """Where wheels are to run. machine: as of `uname -m`. glibc: (2, N). python: (major, minor, micro) of CPython."""

    machine: str
    glibc: tuple[int, int]
    python: tuple[int, int, int]

    def platforms(self) -> list[str]:
        """Return the platform tags of wheels that run there, the newest first."""
        found = []
        for minor in range(self.glibc[1], OLDEST_GLIBC.get(self.machine, 17) - 1, -1):
            found.append(f"manylinux_2_{minor}_{self.machine}")
            if minor in LEGACY:
                found.append(f"{LEGACY[minor]}_{self.machine}")
        return [*found, f"linux_{self.machine}"]

    def tags(self) -> dict[Tag, int]:
        """Return the tags of wheels that run there, each with its rank, the best first."""
        minor, platforms = self.python[:2], self.platforms()
        interpreter = f"cp{minor[0]}{minor[1]}"
        every = [*cpython_tags(minor, [interpreter], platforms), *compatible_tags(minor, interpreter, platforms)]
        return {tag: rank for rank, tag in enumerate(dict.fromkeys(every))}

    def environment(self) -> dict[str, str]:
        """Return the values of markers there."""
        version = ".".join(map(str, self.python))
        return {
            "implementation_name": "cpython",
            "implementation_version": version,
            "os_name": "posix",
            "platform_machine": self.machine,
            "platform_python_implementation": "CPython",
            "platform_release": "",
            "platform_system": "Linux",
            "platform_version": "",
            "python_full_version": version,
            "python_version": f"{self.python[0]}.{self.python[1]}",
            "sys_platform": "linux",
        }

    def runs_what_is_compiled_on(self, other: "CarPlatform | None") -> bool:
        """Tell whether machine code of another computer runs here: same machine and Python, no newer C library."""
        return (
            other is not None
            and other.machine == self.machine
            and other.python[:2] == self.python[:2]
            and other.glibc <= self.glibc
        )

    @property
    def words(self) -> str:
        """Return its name for a person."""
        return f"{self.machine}, CPython {self.python[0]}.{self.python[1]}, glibc {self.glibc[0]}.{self.glibc[1]}"


def platform_of(machine: str, glibc: tuple[int, int] | None, python: CarPython) -> CarPlatform:
    """Return the platform; DeployError where no wheels are made for it."""
    if glibc is None or glibc[0] != 2:
        raise DeployError("the car has no glibc, for which packages are made: install Debian, Ubuntu or JetPack on it")
    return CarPlatform(machine, glibc, python.version)


def read_pins(text: str) -> dict[str, str]:
    """Return the version of each package in constraints (`name==version` a line), by normalized name."""
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    return {
        canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines) if version
    }


def requirements_of(metadata: str) -> list[Requirement]:
    """Return what a wheel requires (core metadata, `Requires-Dist`), markers and all."""
    return [Requirement(line) for line in HeaderParser().parsestr(metadata).get_all("Requires-Dist", ())]


def reach(
    roots: Iterable[Requirement], known: Mapping[str, Sequence[Requirement]], environment: Mapping[str, str]
) -> tuple[list[str], list[Requirement]]:
    """Return the normalized names of what the roots need on a computer, and the needed that are not known yet.

    known: what each package requires, by normalized name.
    """
    needed: dict[str, set[str]] = {}
    unknown: dict[str, Requirement] = {}
    waiting = list(roots)
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        seen = needed.setdefault(name, set())
        fresh = ({"", *wanted.extras}) - seen
        seen |= fresh
        if name not in known:
            unknown.setdefault(name, wanted)
            continue
        for extra in fresh:
            waiting += [one for one in known[name] if _applies(one, environment, extra)]
    return sorted(needed), [unknown[name] for name in sorted(unknown)]


def _applies(requirement: Requirement, environment: Mapping[str, str], extra: str) -> bool:
    if requirement.marker is None:
        return extra == ""
    without = requirement.marker.evaluate({**environment, "extra": ""})
    return without if extra == "" else not without and requirement.marker.evaluate({**environment, "extra": extra})


def pinned(requirement: Requirement, pins: Mapping[str, str]) -> str:
    """Return a requirement as pip takes it, in the version of the constraints where they name it."""
    version = pins.get(canonicalize_name(requirement.name))
    return f"{requirement.name}=={version}" if version is not None else f"{requirement.name}{requirement.specifier}"


def best_wheel(
    files: Iterable[str], requirement: Requirement, pins: Mapping[str, str], tags: Mapping[Tag, int]
) -> str | None:
    """Return the file name of the best wheel for a requirement, the newest first; None where none fits."""
    name = canonicalize_name(requirement.name)
    pin = pins.get(name)
    fitting: list[tuple[Version, int, str]] = []
    for file in files:
        try:
            its_name, version, _, its_tags = parse_wheel_filename(file)
        except InvalidWheelFilename:
            continue
        ranks = [tags[tag] for tag in its_tags if tag in tags]
        right = version == Version(pin) if pin is not None else requirement.specifier.contains(version)
        if its_name == name and right and ranks:
            fitting.append((version, -min(ranks), file))
    return max(fitting)[2] if fitting else None
