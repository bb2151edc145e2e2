"""What a deployment will do, or why it must not begin. Pure: facts and wishes in, a plan or a DeployError out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from wallride.deploy.closure import CarPlatform, platform_of
from wallride.deploy.facts import OLDEST_PYTHON, CarFacts, CarPython, DeployError
from wallride.deploy.python_archive import PythonArchive

MOVABLE: Final = ("armed", "driving", "limited", "stopped")
"""Driving states in which the car drives, or drives as soon as nothing is in its way."""
SPARE_KB: Final = 100 * 1024
"""Disk space that stays free [KiB]."""
COMPILED_SHARE: Final = 1.4
"""Size of installed files over that in the wheels: Python's bytecode comes on top."""
ENVIRONMENT_KB: Final = 20 * 1024
NO_COMPILER: Final = (
    "the car has no compiler, and this computer makes nothing for it: it drives in Python, at half the speed"
)


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the user asked for.

    python: a program on the car, "" for any. keep: number of versions that stay. archive: a Python to bring along.
    """

    rollback: bool = False
    force: bool = False
    start: bool = False
    no_service: bool = False
    python: str = ""
    keep: int = 3
    archive: PythonArchive | None = None


@dataclass(frozen=True, slots=True)
class DeployPlan:
    """The work on the car. python, platform: None for a rollback, which needs neither.

    arguments: of install.sh there. lines: the plan for a person. warnings: what is worse than it could be.
    brings: a Python that the car does not have yet.
    """

    python: CarPython | None
    platform: CarPlatform | None
    arguments: Sequence[str]
    lines: Sequence[str]
    warnings: Sequence[str]
    brings: PythonArchive | None = None


def make_plan(facts: CarFacts, wishes: Wishes, here: CarPlatform | None = None) -> DeployPlan:
    """Return the plan; DeployError where the car must not be touched, or cannot take it.

    here: the platform for which this computer compiles.
    """
    _refuse(facts, wishes)
    if wishes.rollback:
        return _rollback_plan(facts, wishes)
    python, brings = _python(facts, wishes)
    platform = platform_of(facts.machine, facts.glibc, python)
    first = not facts.in_use
    starts = wishes.start or (first and not wishes.no_service)
    warnings = []
    if not facts.has_compiler and not platform.runs_what_is_compiled_on(here):
        warnings.append(f"{NO_COMPILER} (on the car: sudo apt-get install gcc python3-dev)")
    return DeployPlan(
        python,
        platform,
        ["--yes", "--wheelhouse", "wheelhouse", "--python", place_of(brings) if brings else python.path,
         "--keep", str(wishes.keep), *_flags(wishes, starts=starts)],
        [
            f"the car: {platform.words}, Python {python.words}{', which comes along' if brings else ''}",
            f"in use there: {_version_words(facts, facts.in_use) or 'nothing yet'}",
            "build the wheel, gather the wheels that it needs, and copy those that the car lacks",
            "install them into /opt/wallride-versions/DATE, and point /opt/wallride to it",
            _service_line(facts, starts=starts, wanted=not wishes.no_service),
            f"keep {wishes.keep} versions; /etc/wallride and recordings stay as they are",
        ],
        warnings,
        brings,
    )  # fmt: skip


def place_of(archive: PythonArchive) -> str:
    """Return the archive's place in the folder of a deployment on the car."""
    return f"python/{archive.file.name}"


def _python(facts: CarFacts, wishes: Wishes) -> tuple[CarPython, PythonArchive | None]:
    """Return the Python to use, and the archive where it has to come along."""
    archive = wishes.archive
    if archive is None:
        return choose_python(facts.pythons, wishes.python), None
    if archive.machine != facts.machine:
        raise DeployError(f"{archive.file}: is for {archive.machine}, and the car is {facts.machine}")
    there = [python for python in facts.pythons if python.path.startswith(f"{archive.folder}/")]
    return (there[0], None) if there else (archive.python, archive)


def choose_python(pythons: Sequence[CarPython], wanted: str) -> CarPython:
    """Return the Python to use: the wanted one, or the first that is new enough; DeployError where there is none."""
    usable = [python for python in pythons if python.version >= OLDEST_PYTHON]
    if wanted:
        usable = [python for python in usable if wanted in {python.path, python.path.rpartition("/")[2]}]
    if usable:
        return usable[0]
    there = ", ".join(dict.fromkeys(python.words for python in pythons)) or "none"
    which = f"{wanted} is none of 3.11 or newer with the module venv" if wanted else "it needs Python 3.11 or newer"
    raise DeployError(
        f"{which}; on the car there is: {there}. Once, with the car on the internet:"
        " sudo apt-get install python3.11 python3.11-venv. Without: download an archive install_only of"
        " python-build-standalone for the car's machine here, and give it with --python FILE"
    )


def refuse_full_disk(facts: CarFacts, copied: int, installed: int) -> None:
    """Raise DeployError where the car's disk is too small. copied, installed: bytes to copy, and within the wheels."""
    needed = {
        "the copy": (facts.free_copies_kb, copied // 1024),
        "/opt/wallride-versions": (facts.free_versions_kb, int(COMPILED_SHARE * installed / 1024) + ENVIRONMENT_KB),
    }
    for what, (free_kb, need_kb) in needed.items():
        if free_kb < need_kb + SPARE_KB:
            raise DeployError(
                f"the car's disk is too full for {what}: {free_kb // 1024} MB free, {(need_kb + SPARE_KB) // 1024} MB"
                " needed; old recordings: sudo du -sh /var/lib/wallride/recordings; or --keep 2"
            )


def _refuse(facts: CarFacts, wishes: Wishes) -> None:
    if facts.missing_tools:
        raise DeployError(
            f"the car lacks {', '.join(facts.missing_tools)}: install tar, coreutils and util-linux on it"
        )
    if facts.busy:
        raise DeployError("another installation is going on on the car; try again when it has ended")
    if facts.root == "no":
        raise DeployError("the car has no sudo: deploy as root@CAR, or install the package sudo")
    if facts.state in MOVABLE and not wishes.force:
        raise DeployError(f"the car is {facts.state}: let go of the permit, so that it is disarmed; or --force")
    if facts.service == "active" and not facts.state and not wishes.force:
        raise DeployError(
            "the car's service runs and does not say whether it is armed:"
            " stop it there, sudo systemctl stop wallride; or --force"
        )


def _rollback_plan(facts: CarFacts, wishes: Wishes) -> DeployPlan:
    if not facts.before:
        raise DeployError("there is no version before the one in use on the car")
    lines = [
        f"in use there: {_version_words(facts, facts.in_use)}",
        f"point /opt/wallride to the version before: {_version_words(facts, facts.before)}",
        _service_line(facts, starts=wishes.start, wanted=True).partition(";")[0],
    ]
    return DeployPlan(None, None, ["--rollback", *_flags(wishes, starts=wishes.start)], lines, [])


def _flags(wishes: Wishes, *, starts: bool) -> list[str]:
    wanted = {"--force": wishes.force, "--start": starts, "--no-service": wishes.no_service}
    return [name for name, is_wanted in wanted.items() if is_wanted]


def _version_words(facts: CarFacts, path: str) -> str:
    note = facts.note(path)
    return f"{path} ({note})" if note else path


def _service_line(facts: CarFacts, *, starts: bool, wanted: bool) -> str:
    if starts or facts.service in {"active", "activating", "reloading", "failed"}:
        return "start the service, and watch it; where it is not ready, go back to the version before"
    if not wanted:
        return "leave the service alone"
    return "install the service and leave it stopped" if not facts.service else "leave the service stopped, as it is"
