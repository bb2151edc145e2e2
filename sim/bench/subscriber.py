"""Subscriber process: receives all topics of one car until its standard input ends, then reports."""

import asyncio
import json
import sys
import time
from collections import Counter
from typing import Any

from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus


async def listen(endpoint: str, car: str) -> dict[str, Any]:
    """Count messages by topic; keep the first and the newest status."""
    bus = Bus(zenoh_config.client_config(endpoint, None))
    await bus.open()
    counts: Counter[str] = Counter()
    statuses: list[bytes] = []
    received = 0

    def hear(key: str, payload: bytes, _at_s: float) -> None:
        nonlocal received
        counts[key.rpartition("/")[2]] += 1
        received += len(payload)
        if key.endswith("/status"):
            statuses[1:] = [payload]

    bus.subscribe(topics.key(car, "*"), hear)
    began_s = time.monotonic()
    await asyncio.to_thread(sys.stdin.read)
    seconds = time.monotonic() - began_s
    await bus.close()
    status = json.loads(statuses[-1]) if statuses else {}
    return {"seconds": seconds, "messages": dict(counts), "bytes": received, "status": status}


if __name__ == "__main__":
    print(json.dumps(asyncio.run(listen(*sys.argv[1:3]))))  # noqa: T201 - the parent reads it
