"""Errors that the user can correct: one sentence on stderr and exit code 2; and those that nothing expected."""

import argparse
import errno
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path

from wallride.runtime.host.extras import how_to_install
from wallride.runtime.host.terminal_text import complain, one_line, say

UNEXPECTED = 1
ASKED_AGAIN_S = 0.02
OF_A_PLACE = frozenset({
    errno.EACCES, errno.EDQUOT, errno.EEXIST, errno.EFBIG, errno.EIO, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG,
    errno.ENOENT, errno.ENOSPC, errno.ENOTDIR, errno.EPERM, errno.EROFS,
})  # fmt: skip
"""Errors of a file or folder that the user named, or of the disk it is on: not mistakes of the program."""
TRACEBACK_VARIABLE = "WALLRIDE_TRACEBACK"
"""Environment variable: with any value, an unexpected exception is shown whole."""
LAST_ERROR = "last-error.txt"
OWN_PACKAGE = "wallride"


def fail(message: str) -> int:
    """Print the error in one line and return its exit code."""
    return complain(one_line(message))


def fail_at_place(error: OSError) -> int | None:
    """Print in one line which file or output cannot be used, and return the exit code; None for another error."""
    if error.errno not in OF_A_PLACE:
        return None
    if error.filename is None:  # of a write: standard output, or a file that is open
        forget_output()
        return fail(f"the output cannot be written: {error.strerror}; make room, or write it elsewhere")
    return fail(f"{error.filename} cannot be used: {error.strerror}; name another place")


def forget_output() -> None:
    """Let what is still to be written to standard output go nowhere, so that the end of the process says no more."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def open_missing_streams() -> None:
    """Let standard streams that were closed (`COMMAND 2>&-`) lead nowhere, before a file gets their descriptors."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115 - as long as the process runs
            os.set_inheritable(stream.fileno(), True)  # noqa: FBT003 - os has it so
            setattr(sys, name, stream)


def ask_again_for_lost_interrupts() -> None:
    """Raise a Ctrl-C anew that Python has printed as "ignored": imports have callbacks that lose exceptions."""
    shown = sys.unraisablehook

    def ask_again(lost: "sys.UnraisableHookArgs") -> None:
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            shown(lost)
            return
        again = threading.Timer(ASKED_AGAIN_S, signal.raise_signal, (signal.SIGINT,))  # here it would be lost as well
        again.daemon = True
        again.start()

    sys.unraisablehook = ask_again


@contextmanager
def needs(extra: str, subject: str) -> Iterator[None]:
    """Turn a missing package into a sentence and SystemExit; a missing module of our own stays a bug.

    extra: of the installation, that has it. subject: with its verb, "recordings need".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] == OWN_PACKAGE:
            raise
        message = f"{subject} {error.name}: install it with {how_to_install(extra)}"
        raise SystemExit(fail(message)) from None


def later(module: str, extra: str, subject: str) -> Callable[[argparse.Namespace], int]:
    """Return what imports a module when its command runs, and calls its `run`; extra, subject: as of `needs`."""

    def run(options: argparse.Namespace) -> int:
        with needs(extra, subject):
            command = import_module(module)
        return int(command.run(options))

    return run


def report(error: Exception, command: str, environment: Mapping[str, str] = os.environ) -> int:
    """Say that a command failed, and keep the details in a file; returns the exit code."""
    import traceback

    details = "".join(traceback.format_exception(error))
    try:
        place = _keep_details(f"wallride {command}, Python {sys.version.split()[0]}\n{details}", environment)
    except OSError:
        say(details, file=sys.stderr)
        place = "above"
    what = one_line(f"{type(error).__name__}: {error}", 300)
    say(
        f"wallride: {command} failed in a way that it did not expect ({what}). The details are {place};"
        " please report them to wallride's maintainers",
        file=sys.stderr,
    )
    return UNEXPECTED


def _keep_details(details: str, environment: Mapping[str, str]) -> str:
    base = environment.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    path = Path(base) / "wallride" / LAST_ERROR
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(details, encoding="utf-8", errors="backslashreplace")
    return f"in {path}"
