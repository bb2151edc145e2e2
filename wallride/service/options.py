"""What `wallride service` understands: install, uninstall and show the car's systemd service."""

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from wallride.failure import fail
from wallride.parser import Commands
from wallride.runtime.host.terminal_text import say, yes_or_no

RUNNING: Final = Path("run/systemd/system")
RELOADED: Final = (
    ("systemctl", "daemon-reload"),
    ("udevadm", "control", "--reload-rules"),
    ("udevadm", "trigger", "--subsystem-match=tty"),
)
NOT_INSTALLED: Final = 1


def add(commands: Commands) -> None:
    """Add the command and its three actions."""
    service = commands.add_parser("service", help="the car's service, which starts at boot")
    actions = service.add_subparsers(dest="action", required=True, metavar="ACTION")
    install = actions.add_parser("install", help="create user, folders, udev rules and unit; again: what is missing")
    uninstall = actions.add_parser("uninstall", help="stop the service and remove unit and udev rules")
    show = actions.add_parser(
        "status", help="which parts are there, and whether it runs; exit code 1 when one is missing"
    )
    install.add_argument("--now", action="store_true", help="start the car, too")
    uninstall.add_argument("--purge", action="store_true", help="remove settings, keys, RECORDINGS and the user, too")
    for action in (install, uninstall):
        action.add_argument(
            "--yes", action="store_true", help="do not ask; without a terminal it is not done otherwise"
        )
        action.add_argument("--dry-run", action="store_true", help="only say what it would do")
    for action in (install, uninstall, show):
        action.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help="another system, as an image")
        action.add_argument(
            "--prefix", type=Path, default=_prefix(), metavar="DIR", help="where bin/wallride is (default: here)"
        )
        action.set_defaults(run=run)


def _prefix(used: Path = Path("/opt/wallride"), here: Path = Path(sys.prefix)) -> Path:
    """Return where the program is: by the link that stays (`install.sh`), where that leads here."""
    return used if used.resolve() == here.resolve() else here


def run(options: argparse.Namespace) -> int:
    """Do it; exit code 2 with one line when the user can mend it."""
    from wallride.service.parts import ServiceError, visible

    actions = {"install": _install, "uninstall": _uninstall, "status": _status}
    try:
        options.prefix = visible(options.prefix, installs=options.action == "install")
        return actions[options.action](options)
    except ServiceError as error:
        return fail(str(error))
    except OSError as error:
        return fail(f"{error.filename or options.root}: {error.strerror} (run it with sudo)")


def _install(options: argparse.Namespace) -> int:
    from wallride.service.parts import parts

    found = parts(options.root, options.prefix)
    missing = [part for part in found if not part.is_there()]
    for part in found:
        say(f"{'create ' if part in missing else 'is there'} {part.words}")
    start = options.now and _runs(options.root)
    if start:
        say("start   the car now; it comes up disarmed")
    if not missing and not start:
        say("nothing to do")
        return 0
    if not _agreed(options):
        return 0
    before = os.umask(0o022)  # the service reads what root makes here
    try:
        for part in missing:
            part.make()
    finally:
        os.umask(before)
    _reload(options.root)
    if start:
        _tell(("systemctl", "restart", "wallride"))
    say("done; next: edit /etc/wallride/car.toml, then  sudo systemctl start wallride" if not start else "done")
    return 0


def _uninstall(options: argparse.Namespace) -> int:
    from wallride.service.parts import FOLDER, PURGED, has_user, parts, purge

    removed = [part for part in parts(options.root, options.prefix) if part.remove is not None]
    for part in removed:
        say(f"remove  {part.words}")
    kept = [f"/{folder}" for folder in (str(FOLDER), *PURGED) if (options.root / folder).exists()]
    kept += ["user wallride"] if has_user(options.root) else []
    for name in kept:
        say(f"{'remove ' if options.purge else 'keep   '} {name}")
    if not _agreed(options):
        return 0
    if _runs(options.root):
        _tell(("systemctl", "stop", "wallride"))
    for part in reversed(removed):
        if part.remove is not None:
            part.remove()
    if options.purge:
        purge(options.root)
    _reload(options.root)
    say("done")
    return 0


def _status(options: argparse.Namespace) -> int:
    from wallride.service.parts import installed, parts

    found = parts(options.root, options.prefix)
    for part in found:
        say(f"{'is there' if part.is_there() else 'MISSING '} {part.words}")
    if _runs(options.root):
        shown = subprocess.run(
            ["systemctl", "show", "wallride", "--property=ActiveState,SubState,StatusText,NRestarts,ExecMainStatus"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        say(shown.stdout.strip() or "the service manager says nothing of it")
    if installed(found):
        return 0
    say("next: sudo wallride service install")
    return NOT_INSTALLED


def _agreed(options: argparse.Namespace) -> bool:
    """Tell whether to do it; ask where a person is there."""
    from wallride.service.parts import ServiceError

    if options.dry_run:
        say("nothing done (--dry-run)")
        return False
    if not options.yes and not sys.stdin.isatty():
        say("nothing done: say --yes")
        return False
    if os.geteuid() != 0:
        raise ServiceError(f"{options.root} belongs to root: run it with sudo")
    if options.yes or yes_or_no("do it?", default=False):
        return True
    say("nothing done")
    return False


def _runs(root: Path) -> bool:
    """Tell whether the root is this running system, under systemd."""
    return root == Path("/") and (root / RUNNING).is_dir()


def _reload(root: Path) -> None:
    if _runs(root):
        for command in RELOADED:
            _tell(command)


def _tell(command: Sequence[str]) -> None:
    """Run a command of the service manager; a failure is said, and the rest goes on."""
    if shutil.which(command[0]) is None:
        say(f"skipped {' '.join(command)}: {command[0]} is missing")
        return
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        say(f"failed  {' '.join(command)}: {done.stderr.strip()}")
