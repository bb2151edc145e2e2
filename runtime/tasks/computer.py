"""Watches the computer: temperature and throttling in the status, a warning in the log when they begin."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Any, Final, Never

from wallride.runtime.host.computer import ComputerReading

log = logging.getLogger("wallride.computer")

READS_EVERY_S: Final = 5.0


class ComputerWatch:
    """Keeps the newest reading; `read` is called in a thread, because the kernel may ask a chip for it.

    reading: the newest. trouble: what is wrong now with its remedy, "" when all is well.
    """

    def __init__(self, read: Callable[[], ComputerReading]) -> None:
        self._read = read
        self._met = False
        self.reading = ComputerReading()
        self.trouble = ""

    async def watch(self) -> Never:
        """Read for ever."""
        while True:
            self.take(await asyncio.to_thread(self._read))
            await asyncio.sleep(READS_EVERY_S)

    def take(self, reading: ComputerReading) -> None:
        """Take in a reading; events from before the start of the process do not count."""
        before = self.reading if self._met else reading
        self._met, self.reading = True, reading
        trouble = reading.trouble(before)
        if trouble != self.trouble:
            if trouble:
                log.warning("%s", trouble)
            else:
                log.info("the computer is well again")
            self.trouble = trouble

    def status(self) -> Mapping[str, Any]:
        """Return plain values."""
        return {**self.reading.fields(), "trouble": self.trouble}
