"""Delivery of scans from the lidar to its subscribers."""

from collections.abc import Callable, Sequence
from typing import Never

from wallride.drivers.api import Lidar, Scan


async def pump(
    lidar: Lidar, readers: Sequence[Callable[[Scan], None]], timed: Callable[[Scan], None] = lambda _: None
) -> Never:
    """Pass every scan to each reader in the order given: safety first, so that it is served before the others.

    timed: called with every scan before any reader, as soon as the scan is decoded.
    """

    def deliver(scan: Scan) -> None:
        timed(scan)
        for read in readers:
            read(scan)

    await lidar.run(deliver)
