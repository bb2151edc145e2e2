"""The wheels for a car: ours is built, the others come from this computer's cache or by pip, for the car's platform."""

import os
import platform
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from wallride.deploy.closure import CarPlatform, best_wheel, pinned, reach, read_pins, requirements_of
from wallride.deploy.facts import DeployError, read_glibc

OURS: Final = "wallride"
ROOTS: Final = (Requirement("wallride[car]"), Requirement("pip"))
"""pip too: Debian's Python has none without another package."""
REMEDIES: Final = {"pip": "ensurepip", "hatchling": "pip install hatchling"}
"""Modules of this Python that make and gather wheels, each with the one that brings it."""


@dataclass(frozen=True, slots=True)
class Wheelhouse:
    """ours: the wheel of this program. others: what it needs there. downloaded: how many of them came by pip now."""

    ours: Path
    others: Sequence[Path]
    downloaded: int

    def installed_bytes(self) -> int:
        """Return the size of all files in all wheels."""
        return sum(file.file_size for wheel in (self.ours, *self.others) for file in zipfile.ZipFile(wheel).infolist())


def cache_folder() -> Path:
    """Return where wheels for cars stay on this computer."""
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "wallride" / "wheels"


def build_wheel(source: Path, folder: Path, car: CarPlatform) -> Path:
    """Return the wheel of this program, built from a clone into a folder; DeployError where that fails.

    It brings the compiled functions where this computer makes what runs on the car.
    """
    pure = {} if car.runs_what_is_compiled_on(this_platform()) else {"WALLRIDE_PURE_WHEEL": "1"}
    said = _run(["hatchling", "build", "-t", "wheel", "-d", str(folder)], pure, source)
    built = sorted(folder.glob(f"{OURS}-*.whl"))
    if not built:
        raise DeployError(f"{source}: the wheel could not be built: {_last(said)}")
    return built[-1]


def this_platform() -> CarPlatform | None:
    """Return the platform for which this computer compiles; None where that is none that a car has."""
    glibc = read_glibc(os.confstr("CS_GNU_LIBC_VERSION") or "")
    if glibc is None or sysconfig.get_config_var("Py_GIL_DISABLED"):
        return None
    return CarPlatform(platform.machine(), glibc, sys.version_info[:3])


def gather(ours: Path, constraints: Path, car: CarPlatform, cache: Path) -> Wheelhouse:
    """Return all wheels for a car; DeployError where one is not made for its platform, or cannot be downloaded."""
    cache.mkdir(parents=True, exist_ok=True)
    pins, tags = read_pins(constraints.read_text(encoding="utf-8")), car.tags()
    environment = car.environment()
    known = {OURS: requirements_of(read_metadata(ours))}
    wheels: dict[str, Path] = {OURS: ours}
    downloaded = 0
    while True:
        needed, unknown = reach(ROOTS, known, environment)
        if not unknown:
            return Wheelhouse(ours, [wheels[name] for name in needed if name != OURS], downloaded)
        absent = [one for one in unknown if best_wheel(_names(cache), one, pins, tags) is None]
        if absent:
            _download([pinned(one, pins) for one in absent], cache, car)
            downloaded += len(absent)
        for one in unknown:
            name = canonicalize_name(one.name)
            file = best_wheel(_names(cache), one, pins, tags)
            if file is None:
                raise DeployError(f"no wheel of {pinned(one, pins)} for {car.words}")
            wheels[name] = cache / file
            known[name] = requirements_of(read_metadata(wheels[name]))


def read_metadata(wheel: Path) -> str:
    """Return the core metadata of a wheel; DeployError for a file that is damaged."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
            return archive.read(name).decode()
    except (zipfile.BadZipFile, StopIteration, OSError):
        raise DeployError(f"{wheel}: is damaged: delete it and try again") from None


def _names(cache: Path) -> Iterable[str]:
    return [path.name for path in cache.glob("*.whl")]


def _download(requirements: Sequence[str], cache: Path, car: CarPlatform) -> None:
    """Download wheels alone, without what they require: the car's markers decide on that."""
    major, minor, _ = car.python
    platforms = [word for name in car.platforms() for word in ("--platform", name)]
    said = _run(
        ["pip", "--disable-pip-version-check", "--no-input", "download", "--quiet", "--no-deps",
         "--only-binary=:all:", "--implementation", "cp", "--python-version", f"{major}.{minor}",
         "--abi", f"cp{major}{minor}", *platforms, "--dest", str(cache), *requirements], {},
    )  # fmt: skip
    if not said:
        return
    if "no matching distribution" in said.lower():
        wanted = next((line for line in said.splitlines() if "no matching distribution" in line.lower()), "")
        raise DeployError(
            f"{wanted.rpartition(' ')[2] or ', '.join(requirements)}: there is no wheel for {car.words};"
            " another Python on the car (--python) may have one, or install.sh in a clone there compiles it"
        )
    raise DeployError(f"the wheels could not be downloaded: {_last(said)}")


def _run(command: Sequence[str], environment: Mapping[str, str], folder: Path | None = None) -> str:
    """Run a module of this Python in a folder; return what it said where it failed, else nothing."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", *command], capture_output=True, text=True, env={**os.environ, **environment},
        cwd=folder, check=False,
    )  # fmt: skip
    if f"No module named {command[0]}" in done.stderr:
        raise DeployError(f"{sys.executable} has no {command[0]}: {sys.executable} -m {REMEDIES[command[0]]}")
    return (done.stderr.strip() or f"{command[0]} failed") if done.returncode != 0 else ""


def _last(said: str) -> str:
    lines = [line for line in said.splitlines() if "error" in line.lower()] or said.splitlines() or ["it said nothing"]
    return lines[-1].strip()
