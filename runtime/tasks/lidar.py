"""Scans from the lidar into the inboxes of those who wait for them."""

from collections.abc import Sequence
from typing import Never

from drivers.api import Lidar, Scan
from runtime.queues import Inbox


async def pump(lidar: Lidar, inboxes: Sequence[Inbox[Scan]]) -> Never:
    """Hand every scan to each inbox in the order given: safety first, so that it is served before its passengers."""

    def deliver(scan: Scan) -> None:
        for inbox in inboxes:
            inbox.put(scan)

    await lidar.run(deliver)
