"""Watches the computer: heat, throttling and descriptors in the status, a warning in the log when they begin."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Any, Final, Never

from wallride.drivers import spare_descriptors
from wallride.runtime.host.computer import ComputerReading

log = logging.getLogger("wallride.computer")

READS_EVERY_S: Final = 5.0
COUNTS_EVERY_S: Final = 0.5
NO_DESCRIPTOR: Final = (
    "no descriptor is left: connections are refused, the drive goes on; see who connects (ss -tp), raise LimitNOFILE"
)


class ComputerWatch:
    """Keeps the newest reading; `read` is called in a thread, because the kernel may ask a chip for it.

    reading: the newest. trouble: what is wrong now with its remedy, "" when all is well. refusing: number of looks
    that found no descriptor left; zenoh, which accepts the connections, does not tell of those it cannot.
    """

    def __init__(self, read: Callable[[], ComputerReading]) -> None:
        self._read = read
        self._met = False
        self.reading = ComputerReading()
        self.trouble = ""
        self.refusing = 0
        self._refuses = False

    async def watch(self) -> Never:
        """Read for ever."""
        while True:
            self.take(await asyncio.to_thread(self._read))
            for _ in range(round(READS_EVERY_S / COUNTS_EVERY_S)):
                self.look_at_descriptors()
                await asyncio.sleep(COUNTS_EVERY_S)

    def look_at_descriptors(self) -> None:
        """Count a moment without a descriptor; 12 us each."""
        before, self._refuses = self._refuses, spare_descriptors.none_left()
        self.refusing += self._refuses
        if self._refuses and not before:
            log.warning(NO_DESCRIPTOR)

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
        return {**self.reading.fields(), "refusing": self.refusing, "trouble": self.trouble}
