"""The parts of the installed service, each with a look whether it is there, and how it is made and taken away.

Offline: nothing is downloaded, and below another root (an image, a container) nothing is asked of a running system.
Every step is idempotent; a file that belongs to the user is never written twice.
"""

import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

USER: Final = "wallride"
UNIT: Final = Path("etc/systemd/system/wallride.service")
WANTED: Final = Path("etc/systemd/system/multi-user.target.wants/wallride.service")
RULES: Final = Path("etc/udev/rules.d/99-wallride.rules")
FOLDER: Final = Path("etc/wallride")
CAR: Final = FOLDER / "car.toml"
LAWS: Final = FOLDER / "laws"
FOLDER_MODE: Final = 0o1775
"""The service may replace its settings file there and nothing of others, as in /tmp."""
SHIPPED_PREFIX: Final = "/opt/wallride"
"""Where the shipped unit looks for the program."""
HIDDEN: Final = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # noqa: S108 - places that the unit does not see
PURGED: Final = ("var/lib/wallride", "var/cache/wallride")


class ServiceError(Exception):
    """The service cannot be installed as asked; the text names the remedy."""


@dataclass(frozen=True, slots=True)
class ServicePart:
    """One part. words: what it is. is_there: whether it is as wanted.

    make, remove: do it, and undo it; None where nothing is undone.
    """

    words: str
    is_there: Callable[[], bool]
    make: Callable[[], None]
    remove: Callable[[], None] | None = None


def shipped(name: str) -> Path:
    """Return a file that comes with the program: of the clone, or of the installed package."""
    places = [Path(__file__).parents[2] / name, Path(sys.prefix) / "share" / "wallride" / name]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise ServiceError(f"{name} did not come with this program: install wallride again ({places[1]})")
    return found


def visible(prefix: Path, *, installs: bool) -> Path:
    """Return where the service's program is, for one that runs in a prefix; ServiceError to install an unseen one."""
    if installs and set(str(prefix)) & set(" \t\n%\"'\\"):
        raise ServiceError(f"{prefix}: systemd reads a space, a quote or % in it otherwise: choose another folder")
    if not any(prefix.is_relative_to(place) for place in HIDDEN):
        return prefix
    if installs:
        raise ServiceError(
            f"{prefix}: the service sees no home and no temporary folder;"
            f" install into {SHIPPED_PREFIX}: sudo sh install.sh"
        )
    return Path(SHIPPED_PREFIX)


def parts(root: Path, prefix: Path) -> list[ServicePart]:
    """Return the parts in the order in which they are made. root: of the system, "/" for this one."""
    unit = shipped("systemd/wallride.service").read_text(encoding="utf-8").replace(SHIPPED_PREFIX, str(prefix))
    rules = shipped("systemd/99-wallride.rules").read_text(encoding="utf-8")
    car = shipped("config/car.toml").read_text(encoding="utf-8")
    return [
        _group(root, "dialout", "group dialout, which may use serial ports"),
        _group(root, "input", "group input, which may read gamepads"),
        ServicePart(f"system user {USER}, in the group dialout", lambda: has_user(root), lambda: _add_user(root)),
        ServicePart(
            f"/{FOLDER}, where the service may save its settings", lambda: _is_shared(root), lambda: _share(root)
        ),
        ServicePart(f"/{LAWS}, root's, for laws of your own", lambda: _has_laws(root), lambda: _make_laws(root)),
        ServicePart(
            f"/{CAR}, from config/car.toml; yours stays as it is",
            (root / CAR).exists,
            lambda: _write_car(root, car),
        ),
        _file(root, RULES, rules, "names for the devices (udev)"),
        _start_at_boot(root),  # before the unit, which tells a later installation that this was done
        _file(root, UNIT, unit, f"the unit, running {prefix}/bin/wallride"),
    ]


def _start_at_boot(root: Path) -> ServicePart:
    """Return the start at boot: made by the first installation; where the unit is there without it, it was disabled."""
    wanted = root / WANTED
    disabled = (root / UNIT).is_file() and not wanted.is_symlink()
    words = (
        "start at boot" if not disabled else "start at boot: disabled, and stays so (sudo systemctl enable wallride)"
    )
    return ServicePart(
        words,
        lambda: disabled or wanted.is_symlink(),
        lambda: _enable(root),
        lambda: wanted.unlink(missing_ok=True),
    )


def has_user(root: Path) -> bool:
    """Tell whether the service's user exists."""
    return _entry(root, "passwd", USER) is not None


def purge(root: Path) -> None:
    """Remove what a removal otherwise keeps: settings, keys, recordings, caches and the user."""
    for folder in (str(FOLDER), *PURGED):
        if (root / folder).exists():
            shutil.rmtree(root / folder)
    if has_user(root):
        _call(root, "userdel", USER)


def _file(root: Path, path: Path, text: str, words: str) -> ServicePart:
    def is_there() -> bool:
        return (root / path).is_file() and (root / path).read_text(encoding="utf-8") == text

    def make() -> None:
        target = root / path
        target.parent.mkdir(parents=True, exist_ok=True)
        fresh = target.with_name(f"{target.name}.new")
        fresh.write_text(text, encoding="utf-8")
        fresh.chmod(0o644)
        fresh.replace(target)  # in one step: a reader never sees half a unit

    return ServicePart(f"/{path}: {words}", is_there, make, lambda: (root / path).unlink(missing_ok=True))


def _group(root: Path, name: str, words: str) -> ServicePart:
    return ServicePart(
        words, lambda: _entry(root, "group", name) is not None, lambda: _call(root, "groupadd", "--system", name)
    )


def _entry(root: Path, table: str, name: str) -> list[str] | None:
    """Return the fields of a line of /etc/passwd or /etc/group; these files are the accounts of an image, too."""
    path = root / "etc" / table
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return next((fields for line in lines if (fields := line.split(":"))[0] == name), None)


def _add_user(root: Path) -> None:
    group = ("--gid", USER) if _entry(root, "group", USER) else ("--user-group",)  # userdel leaves one with a member
    _call(
        root, "useradd", "--system", *group, "--groups", "dialout", "--no-create-home",
        "--home-dir", "/nonexistent", "--shell", "/usr/sbin/nologin", USER,
    )  # fmt: skip


def _call(root: Path, *command: str) -> None:
    """Run a command of the account tools, below a root where it is another one."""
    program, *arguments = command
    path = shutil.which(program, path="/usr/sbin:/sbin:/usr/bin:/bin")
    if path is None:
        raise ServiceError(f"{program} is missing: install the package passwd (Debian) or shadow-utils (Fedora)")
    below = [] if root == Path("/") else ["--prefix", str(root)]
    done = subprocess.run([path, *below, *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = "; ".join(done.stderr.strip().splitlines())
        raise ServiceError(f"{program}: {said or f'exit code {done.returncode}'}")


def _numbers(root: Path) -> tuple[int, int]:
    fields = _entry(root, "passwd", USER)
    if fields is None:
        raise ServiceError(f"the user {USER} is missing")
    return int(fields[2]), int(fields[3])


def _is_shared(root: Path) -> bool:
    folder = root / FOLDER
    if not folder.is_dir() or not has_user(root):
        return False
    found = folder.stat()
    return found.st_gid == _numbers(root)[1] and stat.S_IMODE(found.st_mode) == FOLDER_MODE


def _share(root: Path) -> None:
    folder = root / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    shutil.chown(folder, 0, _numbers(root)[1])
    folder.chmod(FOLDER_MODE)


def _has_laws(root: Path) -> bool:
    """Tell whether the folder is there and root's; the service could have made one of its own there."""
    try:
        found = (root / LAWS).lstat()
    except FileNotFoundError:
        return False
    return stat.S_ISDIR(found.st_mode) and (found.st_uid, stat.S_IMODE(found.st_mode)) == (0, 0o755)


def _make_laws(root: Path) -> None:
    try:
        (root / LAWS).mkdir()
    except FileExistsError:
        raise ServiceError(
            f"/{LAWS} is not a folder of root's with mode 755: look at what is in it, and move it away"
        ) from None
    (root / LAWS).chmod(0o755)


def _write_car(root: Path, text: str) -> None:
    with (root / CAR).open("x", encoding="utf-8") as file:
        file.write(text)
        os.fchmod(file.fileno(), 0o644)
        os.fchown(file.fileno(), *_numbers(root))  # last: from now on its name may lead to any file


def _enable(root: Path) -> None:
    link = root / WANTED
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(f"/{UNIT}")


def installed(found: Sequence[ServicePart]) -> bool:
    """Tell whether all parts are there."""
    return all(part.is_there() for part in found)
