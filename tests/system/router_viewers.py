"""What viewers at a router cost the car itself: `python -m tests.system.router_viewers --rounds 3`.

By turns a simulated car drives with one and with many viewers of all its topics at a router; the viewers run at
niceness 19 and the router at 15, so that on one computer they take the time that the car leaves, as on computers of
their own. What remains are the caches and memory that they share with it, and a scheduler's switch to the car.
"""

import argparse
import asyncio
import contextlib
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from wallride.clients.monitor.outbox import FROM_CAR
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import client_config

ROUTER_NICE, VIEWERS_NICE = "15", "19"
SETTLING_S = 4.0


async def view(endpoint: str, count: int) -> None:
    """Be the viewers, until this process is ended."""
    buses = [Bus(client_config(endpoint, None)) for _ in range(count)]
    for bus in buses:
        for topic in FROM_CAR:
            bus.subscribe(topics.key("*", topic), lambda *_: None)
        while not bus.is_open:
            with contextlib.suppress(OSError):  # on a full computer what has niceness 19 comes late
                await bus.open()
    await asyncio.Event().wait()


async def drive(endpoint: str, seconds: float) -> dict[str, float]:
    """Return p50 and p99 of one drive with the router as its uplink [ms]."""
    with tempfile.TemporaryDirectory() as folder:
        summary = Path(folder) / "summary.json"
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "wallride", "sim", "loop", "--headless", "--duration", str(seconds), "--json",
            str(summary), "--set", f'telemetry.connect=["{endpoint}"]', "--set", "telemetry.any_port=true",
            env={**os.environ, "XDG_DATA_HOME": folder, "XDG_STATE_HOME": folder},
            stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
        await process.wait()
        found: dict[str, float] = json.loads(summary.read_text())["scan_to_motor_ms"]
        return found


async def measure(counts: Sequence[int], rounds: int, seconds: float) -> None:
    """Drive by turns, and print a line for each number of viewers."""
    endpoint, found = free_endpoint(), {count: [] for count in counts}  # type: dict[int, list[dict[str, float]]]
    router = await _niced(ROUTER_NICE, "-m", "wallride", "router", "--listen", endpoint)
    try:
        await asyncio.sleep(SETTLING_S)
        for number in range(rounds):
            for count in counts if number % 2 == 0 else tuple(reversed(counts)):
                viewers = await _niced(VIEWERS_NICE, "-m", __spec__.name, "--view", endpoint, str(count))
                try:
                    found[count].append(await drive(endpoint, seconds))
                finally:
                    viewers.kill()
                    await viewers.wait()
    finally:
        router.kill()
        await router.wait()
    for count, drives in found.items():
        p99s_ms = [one["p99"] for one in drives]
        shown = ", ".join(f"{p99_ms:.2f}" for p99_ms in p99s_ms)
        print(  # noqa: T201 - its output
            f"{count} viewers: p50 {median(one['p50'] for one in drives):.2f} ms, p99 {median(p99s_ms):.2f} ({shown})"
        )


async def _niced(niceness: str, *arguments: str) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        "nice", "-n", niceness, sys.executable, *arguments, stdout=asyncio.subprocess.DEVNULL
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--view", nargs=2, metavar=("ENDPOINT", "COUNT"), help=argparse.SUPPRESS)
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    if options.view is not None:
        asyncio.run(view(options.view[0], int(options.view[1])))
    else:
        asyncio.run(measure((1, options.viewers), options.rounds, options.seconds))


if __name__ == "__main__":
    main()
