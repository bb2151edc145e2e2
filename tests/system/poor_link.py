"""A poor Wi-Fi between car and client: a TCP relay on loopback with delay, pauses as of losses, a rate, and stalls.

`python -m tests.system.poor_link` prints the age at which a client behind it hears each topic: the difference to
a client on the same computer without the relay, for the same bytes.
"""

import argparse
import asyncio
import contextlib
import random
import socket
import tempfile
import time
from collections import Counter, defaultdict, deque
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from tests.system.bench import bench
from wallride.clients.monitor.outbox import FROM_CAR
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import client_config

CAR = "sim"
SEGMENT_B = 1460
NAMES = tuple(name for name in FROM_CAR if name != topics.DISTANCE_ERROR)
"""Topics of the page; equal bytes, as of a distance error that stays, have no age."""


@dataclass(frozen=True)
class Quality:
    """delay_s +- jitter_s one way; a share of segments is lost, which costs TCP pause_s; rate_bps each way."""

    delay_s: float = 0.05
    jitter_s: float = 0.03
    loss: float = 0.05
    pause_s: float = 0.2
    rate_bps: float = 2e6


class PoorLink:
    """The relay. Its buffers are small: what does not fit waits in the sender's, as at a radio."""

    def __init__(self, car_port: int, quality: Quality, seed: int = 1) -> None:
        self._car_port, self._quality, self._random = car_port, quality, random.Random(seed)
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._stalled_until_s = 0.0

    @property
    def endpoint(self) -> str:
        assert self._server is not None
        return f"tcp/127.0.0.1:{self._server.sockets[0].getsockname()[1]}"

    async def start(self) -> None:
        self._server = await asyncio.start_server(self._relay, "127.0.0.1", 0, limit=4 * SEGMENT_B)

    def stall(self, seconds: float) -> None:
        """Let nothing through for this time, in either direction; what waited then arrives late."""
        self._stalled_until_s = time.monotonic() + seconds

    async def close(self) -> None:
        assert self._server is not None
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        plain = socket.socket()
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
        plain.connect(("127.0.0.1", self._car_port))
        plain.setblocking(False)
        to_car = await asyncio.open_connection(sock=plain, limit=4 * SEGMENT_B)
        for pipe in (self._pipe(reader, to_car[1]), self._pipe(to_car[0], writer)):
            task = asyncio.create_task(pipe)
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _pipe(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        quality, queue, free_s, last_s = self._quality, deque[tuple[float, bytes]](), 0.0, 0.0
        delivering = asyncio.create_task(self._deliver(queue, writer))
        try:
            while data := await reader.read(SEGMENT_B):
                free_s = max(time.monotonic(), free_s, self._stalled_until_s) + len(data) * 8 / quality.rate_bps
                late_s = quality.delay_s + self._random.uniform(-1, 1) * quality.jitter_s
                late_s += quality.pause_s if self._random.random() < quality.loss else 0.0
                last_s = max(last_s, free_s + late_s)  # in order, as TCP: a lost segment holds up the others
                queue.append((last_s, data))
                await asyncio.sleep(max(0.0, free_s - time.monotonic()))
        finally:
            delivering.cancel()
            writer.close()

    async def _deliver(self, queue: deque[tuple[float, bytes]], writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                while queue and max(queue[0][0], self._stalled_until_s) <= time.monotonic():
                    writer.write(queue.popleft()[1])
                await asyncio.sleep(0.002)


class Ages:
    """Ages of what a client behind a link hears [s], by topic."""

    def __init__(self) -> None:
        self._here: dict[bytes, float] = {}
        self.sent: Counter[str] = Counter()
        self.age_s: dict[str, list[float]] = defaultdict(list)

    def listen(self, here: Bus, there: Bus, names: tuple[str, ...]) -> None:
        for name in names:
            here.subscribe(topics.key(CAR, name), partial(self._note, name))
            there.subscribe(topics.key(CAR, name), partial(self._hear, name))

    def _note(self, name: str, _key: str, payload: bytes, arrival_s: float) -> None:
        self.sent[name] += 1
        self._here[payload] = arrival_s

    def _hear(self, name: str, _key: str, payload: bytes, arrival_s: float) -> None:
        if payload in self._here:
            self.age_s[name].append(arrival_s - self._here.pop(payload))


async def measure(quality: Quality, seconds: float, stall_s: float, names: tuple[str, ...]) -> Ages:
    """Return the ages over a link of this quality; stall_s: of one stall in the middle, 0 for none."""
    endpoint = free_endpoint()
    with tempfile.TemporaryDirectory() as folder:
        settings = ("telemetry.enabled=true", f"telemetry.listen={endpoint}")
        async with bench(Path(folder), *settings) as car:
            await car.until_driving()
            link = PoorLink(int(endpoint.rpartition(":")[2]), quality)
            await link.start()
            ages = Ages()
            near, far = (Bus(client_config(place, None)) for place in (endpoint, link.endpoint))
            ages.listen(near, far, names)
            await near.open()
            await far.open()
            await asyncio.sleep(seconds / 2)
            if stall_s:
                link.stall(stall_s)
            await asyncio.sleep(seconds / 2)
            await far.close()
            await near.close()
            await link.close()
    return ages


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--stall", type=float, default=0.0)
    parser.add_argument("--mbps", type=float, default=2.0)
    options = parser.parse_args()
    quality = Quality(rate_bps=options.mbps * 1e6)
    ages = asyncio.run(measure(quality, options.seconds, options.stall, NAMES))
    print(f"{quality}, stall {options.stall:g} s")  # noqa: T201 - its output
    for name, age_s in ages.age_s.items():
        p50, p95, worst = np.percentile(age_s, [50, 95, 100]) * 1000
        rates = f"{len(age_s) / options.seconds:5.1f} of {ages.sent[name] / options.seconds:5.1f} /s"
        print(f"{name:15} {rates}  age p50 {p50:5.0f}  p95 {p95:5.0f}  max {worst:5.0f} ms")  # noqa: T201 - its output


if __name__ == "__main__":
    main()
