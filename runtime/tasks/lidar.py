"""Scans from the lidar to everybody who wants them."""

from collections.abc import Callable, Sequence
from typing import Never

from drivers.api import Lidar, Scan


async def pump(lidar: Lidar, readers: Sequence[Callable[[Scan], None]]) -> Never:
    """Hand every scan to each reader in the order given: safety first, so that it is served before its passengers."""

    def deliver(scan: Scan) -> None:
        for read in readers:
            read(scan)

    await lidar.run(deliver)
