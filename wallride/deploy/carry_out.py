"""One deployment from login to the answer of the new version."""

import getpass
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from wallride.deploy.facts import CarFacts, DeployError, read_facts
from wallride.deploy.plan import DeployPlan, Wishes, make_plan, place_of, refuse_full_disk
from wallride.deploy.ssh import NOT_SSH, SshConnection
from wallride.deploy.transfer import Shipment, absent_wheels, send
from wallride.deploy.wheelhouse import build_wheel, cache_folder, gather, this_platform
from wallride.runtime.host.ownership import user_name
from wallride.runtime.host.terminal_text import one_line

NOT_READY: Final = 3
"""Exit code of install.sh, and ours: the service is not ready with the version that was to be used."""
SOURCE_FILES: Final = ("install.sh", "constraints.txt", "pyproject.toml")
PYTHON_UNPACKED: Final = 4
"""Size of a Python over that of its archive."""
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class DeployTarget:
    """Where to deploy, and from where. host: as for ssh. config: for `ssh -F`. source: a clone."""

    host: str
    config: Path | None
    source: Path


def deploy(target: DeployTarget, wishes: Wishes, say: Say, *, dry_run: bool) -> int:
    """Deploy, or only say what would be done; return the exit code. DeployError: nothing was changed on the car."""
    with SshConnection(target.host, target.config) as car:
        facts = read_facts(car.ask("facts"))
        plan = make_plan(facts, wishes, this_platform())
        for line in plan.lines:
            say(one_line(line))
        for warning in plan.warnings:
            say(one_line(f"warning: {warning}"))
        if dry_run:
            say("nothing done (--dry-run)")
            return 0
        password = _password(car, facts)
        with tempfile.TemporaryDirectory(prefix="wallride-deploy-") as folder:
            identity = f"d-{secrets.token_hex(6)}"
            _copy(car, target.source, plan, facts, DeployParcel(identity, Path(folder), say))
        return _install(car, identity, facts, plan, password)


@dataclass(frozen=True, slots=True)
class DeployParcel:
    """A deployment on its way. identity: of its folder on the car. folder: for what is made here."""

    identity: str
    folder: Path
    say: Say


def find_source(named: Path | None, here: Path) -> Path:
    """Return the clone to deploy: the named one, that of this program, or the working folder; DeployError without.

    here: the folder in which this program's packages lie.
    """
    places = [named] if named is not None else [here, Path.cwd()]
    for place in places:
        if all((place / name).is_file() for name in SOURCE_FILES):
            return place.resolve()
    where = f"{named}: is" if named is not None else "this is"
    raise DeployError(f"{where} no clone of wallride, from which the wheel is built: name one with --source DIR")


def build_note(source: Path) -> str:
    """Return one line on what is deployed: the commit, whether it was edited, the time and this computer."""
    git = ["git", "-C", str(source), "describe", "--always", "--dirty=, edited", "--abbrev=10"]
    try:
        commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip() or "no commit"
    except OSError:
        commit = "no commit"
    return (
        f"{commit}, deployed {time.strftime('%Y-%m-%d %H:%M', time.gmtime())} UTC by {user_name('an unnamed user')}\n"
    )


def _password(car: SshConnection, facts: CarFacts) -> str:
    """Return sudo's password, checked on the car; "" where it asks for none."""
    if facts.root != "password":
        return ""
    if not sys.stdin.isatty():
        raise DeployError(f"{car.host}: sudo asks for a password: run this in a terminal, or deploy as root@CAR")
    password = getpass.getpass(f"[sudo] password on {car.host}: ")
    car.ask("may_sudo", text=f"{password}\n")
    return password


def _copy(car: SshConnection, source: Path, plan: DeployPlan, facts: CarFacts, parcel: DeployParcel) -> None:
    """Make and copy what install.sh needs there."""
    if plan.platform is None:
        send(car, parcel.identity, Shipment({"install.sh": source / "install.sh"}), [])
        return
    start_s = time.monotonic()
    ours = build_wheel(source, parcel.folder, plan.platform)
    house = gather(ours, source / "constraints.txt", plan.platform, cache_folder())
    parcel.say(
        f"{ours.name} built, {len(house.others)} other wheels ({house.downloaded} downloaded), {_since(start_s)}"
    )
    start_s = time.monotonic()
    absent = absent_wheels(car, house.others)
    brought = [plan.brings.file] if plan.brings else []
    copied = sum(path.stat().st_size for path in (ours, *absent, *brought))
    unpacked = PYTHON_UNPACKED * sum(path.stat().st_size for path in brought)
    refuse_full_disk(facts, copied, house.installed_bytes() + unpacked)
    note = parcel.folder / "build.txt"
    note.write_text(build_note(source), encoding="utf-8")
    own = {name: source / name for name in ("install.sh", "constraints.txt")}
    own |= {"build.txt": note, f"wheelhouse/{ours.name}": ours}
    own |= {place_of(plan.brings): plan.brings.file} if plan.brings else {}
    send(car, parcel.identity, Shipment(own, house.others), absent)
    parcel.say(f"copied {copied / 1e6:.1f} MB, {len(absent)} of the other wheels, {_since(start_s)}")


def _install(car: SshConnection, identity: str, facts: CarFacts, plan: DeployPlan, password: str) -> int:
    """Let install.sh work; return 0 or NOT_READY. DeployError where it changed nothing, or the connection ended."""
    how = {"yes": "root", "sudo": "sudo", "password": "password"}[facts.root]
    try:
        code = car.watch("install", identity, how, *plan.arguments, text=f"{password}\n")
    except KeyboardInterrupt:
        code = NOT_SSH
    if code in {0, NOT_READY}:
        return code
    if code == NOT_SSH:
        raise DeployError(
            f"{car.host}: the connection has ended; the car goes on by itself and keeps a version that is ready."
            " Look with  wallride deploy --dry-run  when it can be reached"
        )
    raise DeployError(f"{car.host}: the installation failed, as it says above; nothing was changed in use")


def _since(start_s: float) -> str:
    return f"{time.monotonic() - start_s:.0f} s"
