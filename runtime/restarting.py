"""A new start of this process with its own command line: by the service manager, or in its own place.

The car's files are read before the process ends, so that a mistake in them is told to the person who asks for the
restart, and the car that runs goes on.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from wallride.runtime.line_files import read_course, why_no_line
from wallride.runtime.map_files import MapError
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.settings.tree import SettingsError, load_settings

DRIVES_OFF = 'operator.permit = "always" would have the car drive as soon as it has started: restart it by hand'


class ProcessRestart:
    """A restart of the process of one car.

    file, saved, assignments: of its settings, as of its command line. end: ends the drive in order. wanted: whether
    the process is to be started again once it has ended.
    """

    def __init__(self, file: Path | None, saved: Path | None, assignments: Sequence[str]) -> None:
        self._file, self._saved, self._assignments = file, saved, assignments
        self.end: Callable[[], object] = lambda: None
        self.wanted = False

    def check(self) -> None:
        """Read settings, map and line of the next start; UnacceptableError with what keeps the car from starting."""
        try:
            settings = load_settings(self._file, self._assignments, self._saved)
            read_course(settings.map, settings.car)
        except (SettingsError, MapError) as error:
            raise UnacceptableError(f"no restart: the car would not start: {error}") from None
        if why_not := why_no_line(settings.wall_follow, settings.map):
            raise UnacceptableError(f"no restart: {why_not}")
        if settings.operator.permit == "always":
            raise UnacceptableError(f"no restart: {DRIVES_OFF}")

    def begin(self) -> None:
        """End the drive; `start_again` follows."""
        self.wanted = True
        self.end()


def start_again(environment: Mapping[str, str] = os.environ) -> int:
    """Start this process's own command line in its place, or leave that to the service manager; return its exit code.

    A service manager watches from the start on how often the process answers, so it must be the one that starts it:
    the unit has `Restart=always`.
    """
    if not environment.get("NOTIFY_SOCKET"):
        sys.stdout.flush()
        sys.stderr.flush()
        os.execv(sys.executable, sys.orig_argv)  # noqa: S606 - there is no shell, and the command line is this process's
    return 0
