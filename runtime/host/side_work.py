"""Work that neither decides nor drives: an error in it is counted, named and tried again, and ends no drive.

Telemetry, learning, files, what is shown: all that runs beside the way from the lidar's bytes to the motor's.
"""

import asyncio
import logging
import traceback
from collections.abc import Awaitable, Callable
from typing import Final, Never, ParamSpec

from wallride.drivers.api import Clock
from wallride.runtime.host.rate_limited_log import RateLimitedLog

log = logging.getLogger("wallride.side_work")

RETRY_AFTER_S: Final = 1.0
P = ParamSpec("P")


class SideWork:
    """Keeps the errors of each kind of side work; the kinds are few and defined by this program."""

    def __init__(self, clock: Clock) -> None:
        self._log = RateLimitedLog(log, clock)
        self._failed: dict[str, tuple[int, str]] = {}

    @property
    def words(self) -> tuple[str, ...]:
        """What has failed since the start, in sentences for the user."""
        return tuple(
            f"{name} failed {count} times, tried again, the drive goes on: {text}; please report it"
            for name, (count, text) in self._failed.items()
        )

    def note(self, name: str, error: Exception) -> None:
        """Count an error, and log it with its place."""
        place = traceback.extract_tb(error.__traceback__)[-1:]
        at = f" ({place[0].filename.rsplit('/', 1)[-1]}:{place[0].lineno})" if place else ""
        text = f"{type(error).__name__}: {error}{at}"
        self._failed[name] = self._failed.get(name, (0, ""))[0] + 1, text
        self._log.log(name, f"{name} failed, the drive goes on: {text}", logging.ERROR)

    def guarded(self, name: str, call: Callable[P, object]) -> Callable[P, None]:
        """Return a call that notes an error instead of raising it.

        Without memory the drive ends in order: soon numpy or the interpreter would crash, and then nothing brakes.
        """

        def guarded(*args: P.args, **kwargs: P.kwargs) -> None:
            try:
                call(*args, **kwargs)
            except MemoryError:
                raise
            except Exception as error:  # noqa: BLE001 - whatever it is, it must not end the drive
                self.note(name, error)

        return guarded

    async def keep(self, name: str, job: Callable[[], Awaitable[object]]) -> Never:
        """Run a job for ever; after an error it is begun anew. Without memory the drive ends, as in `guarded`."""
        while True:
            try:
                await job()
            except MemoryError:
                raise
            except Exception as error:  # noqa: BLE001 - whatever it is, it must not end the drive
                self.note(name, error)
            await asyncio.sleep(RETRY_AFTER_S)
