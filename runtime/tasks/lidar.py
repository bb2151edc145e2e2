"""Delivers scans from the lidar to its subscribers."""

from collections.abc import Callable, Sequence
from typing import Never

from drivers.api import Lidar, Scan


async def pump(
    lidar: Lidar, readers: Sequence[Callable[[Scan], None]], timed: Callable[[Scan], None] = lambda _: None
) -> Never:
    """Hand every scan to each reader in the order given: safety first, so that it is served before its passengers.

    timed: told of every scan before anybody else, as soon as it is decoded.
    """

    def deliver(scan: Scan) -> None:
        timed(scan)
        for read in readers:
            read(scan)

    await lidar.run(deliver)
