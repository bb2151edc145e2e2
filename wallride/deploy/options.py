"""Options of `wallride deploy`. Its work is imported when the command runs."""

import argparse
from pathlib import Path

from wallride.failure import fail, needs
from wallride.parser import Commands
from wallride.runtime.host.terminal_text import say

MIN_KEPT, MAX_KEPT = 2, 99


def add(commands: Commands) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "deploy",
        help="install this clone on a car over ssh, or update it; the car needs no internet",
        description="Builds the wheel, takes the wheels for the car's machine and Python along, installs them beside"
        " the version in use, switches, restarts the service and watches it; where it is not ready, the version before"
        " is put back. The first time and every other are the same command. Exit code: 0 done, 2 nothing was changed,"
        " 3 the new version is not ready, and the one before is in use again.",
    )
    parser.set_defaults(run=run)
    parser.add_argument("host", metavar="USER@CAR", help="as for ssh; the user is root or may use sudo")
    parser.add_argument("--dry-run", action="store_true", help="ask the car, and only say what would be done")
    parser.add_argument("--rollback", action="store_true", help="switch back to the version before")
    parser.add_argument(
        "--force", action="store_true", help="also while the car is armed or drives: it stops, and comes up disarmed"
    )
    parser.add_argument(
        "--start",
        action="store_true",
        help="start the service also where it was stopped (the first time it is started)",
    )
    parser.add_argument(
        "--no-service", action="store_true", help="do not install the service; one that runs is restarted"
    )
    parser.add_argument(
        "--keep", type=_kept, default=3, metavar="N", help="versions that stay on the car, 2 or more (default: 3)"
    )
    parser.add_argument(
        "--python",
        default="",
        metavar="PROGRAM|FILE",
        help="a program on the car (default: the first of 3.11 or newer), or a file here that comes along: an archive"
        " install_only.tar.gz of python-build-standalone for the car's machine",
    )
    parser.add_argument(
        "--source", type=Path, metavar="DIR", help="the clone to deploy (default: that of this program, or this folder)"
    )
    parser.add_argument("--ssh-config", type=Path, metavar="FILE", help="as ssh -F: port, key, jump host")


def run(options: argparse.Namespace) -> int:
    """Deploy; exit code 2 with one line where nothing was changed."""
    with needs("deploy", "deploying needs"):
        from wallride.deploy.carry_out import DeployTarget, deploy, find_source
    from wallride.deploy.facts import DeployError
    from wallride.deploy.plan import Wishes
    from wallride.deploy.python_archive import SUFFIX, read_archive

    try:
        archive = read_archive(Path(options.python)) if options.python.endswith(SUFFIX) else None
        python = "" if archive else options.python
        wishes = Wishes(
            options.rollback, options.force, options.start, options.no_service, python, options.keep, archive
        )
        source = find_source(options.source, Path(__file__).resolve().parents[2])
        return deploy(DeployTarget(options.host, options.ssh_config, source), wishes, say, dry_run=options.dry_run)
    except DeployError as error:
        return fail(str(error))


def _kept(text: str) -> int:
    if not text.isdecimal() or not MIN_KEPT <= int(text) <= MAX_KEPT:
        raise argparse.ArgumentTypeError(f"{text} is not {MIN_KEPT} to {MAX_KEPT}")
    return int(text)
