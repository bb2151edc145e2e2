"""Publishers shaped like cars, through one router, to viewers who also command: `python -m tests.system.fleet_load`.

Each viewer watches one car with all topics of the page, sends it 50 commands a second, and sees which cars there are;
one of them also hears the status of every car. Cars publish what is wanted, at the car's rates and sizes. Times are of
the one computer's clock.
"""

import argparse
import asyncio
import contextlib
import json
import struct
import sys
import time
from collections import Counter

import numpy as np

from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import client_config

SHAPE = {
    topics.OUTPUT: (40.0, 60), topics.SCAN: (20.0, 4400), topics.ODOM: (20.0, 730), topics.STATUS: (10.0, 3000),
    topics.DECISION: (5.0, 300), topics.WALL: (10.0, 900), topics.FOOTPRINT: (10.0, 900), topics.BEAT: (50.0, 55),
}  # fmt: skip
"""Rate [1/s] and size [byte] of each topic of a car that is watched."""
COMMAND = struct.Struct("<dI48x")
COMMAND_PERIOD_S = 0.02


def name_of(number: int) -> str:
    return f"car{number}"


async def publish(endpoint: str, first: int, count: int, seconds: float) -> dict[str, list[float]]:
    """Be some of the cars; return the age of each command on its arrival, and the numbers that came, by car."""
    ages_s: list[float] = []
    came: Counter[str] = Counter()

    def on_command(key: str, payload: bytes, arrival_s: float) -> None:
        sent_s, _ = COMMAND.unpack(payload)
        ages_s.append(arrival_s - sent_s)
        came[key] += 1

    cars = [(name_of(first + k), Bus(client_config(endpoint, None))) for k in range(count)]
    for name, bus in cars:
        bus.subscribe(topics.key(name, topics.COMMAND), on_command)
        bus.announce(topics.key(name, topics.ALIVE))
        await bus.open()
    driving = [asyncio.create_task(_speak(name, bus)) for name, bus in cars]
    await asyncio.sleep(seconds)
    for task in driving:
        task.cancel()
    for _, bus in cars:
        await bus.close()
    return {"ages_s": ages_s, "came": [float(number) for number in came.values()]}


async def _speak(name: str, bus: Bus) -> None:
    keys = {topic: topics.key(name, topic) for topic in SHAPE}
    due_s = dict.fromkeys(SHAPE, time.monotonic())
    wanted, asked_s = dict.fromkeys(SHAPE, False), 0.0
    while True:
        now_s = time.monotonic()
        if now_s - asked_s > 0.5:
            wanted, asked_s = {topic: bus.wanted(key) for topic, key in keys.items()}, now_s
        for topic, (rate_hz, size) in SHAPE.items():
            if now_s >= due_s[topic]:
                due_s[topic] = max(now_s, due_s[topic] + 1 / rate_hz)
                if wanted[topic]:
                    bus.put(keys[topic], bytes(size), encoding=BYTES, urgent=topic == topics.BEAT)
        await asyncio.sleep(0.02)


async def view(endpoint: str, viewers: int, cars: int, seconds: float) -> dict[str, list[float]]:
    """Be the viewers; return the number of samples that each heard, of commands that each sent, and of cars seen."""
    heard: Counter[int] = Counter()
    seen: list[set[str]] = [set() for _ in range(viewers)]
    buses = [Bus(client_config(endpoint, None)) for _ in range(viewers)]
    sent: list[float] = [0.0] * viewers
    for k, bus in enumerate(buses):
        car = name_of(k * cars // viewers)
        for topic in SHAPE:
            bus.subscribe(topics.key(car, topic), lambda *_, k=k: heard.update([k]))
        bus.watch(topics.key("*", topics.ALIVE), lambda key, _alive, k=k: seen[k].add(key))
        await bus.open()
    buses[0].subscribe(topics.key("*", topics.STATUS), lambda *_: heard.update([0]))
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        for k, bus in enumerate(buses):
            sent[k] += 1
            payload = COMMAND.pack(time.monotonic(), int(sent[k]))
            bus.put(topics.key(name_of(k * cars // viewers), topics.COMMAND), payload, encoding=BYTES, urgent=True)
        await asyncio.sleep(COMMAND_PERIOD_S)
    await asyncio.sleep(0.5)
    for bus in buses:
        await bus.close()
    return {"heard": [float(heard[k]) for k in range(viewers)], "sent": sent, "seen": [float(len(one)) for one in seen]}


@contextlib.asynccontextmanager
async def child(*arguments: str):
    process = await asyncio.create_subprocess_exec(sys.executable, *arguments, stdout=asyncio.subprocess.PIPE)
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def measure(cars: int, viewers: int, seconds: float) -> None:
    """Run it once and print the figures."""
    endpoint, me = free_endpoint(), ("-m", "tests.system.fleet_load", "--as")
    half = cars // 2
    async with child("-m", "wallride", "router", "--listen", endpoint) as router:
        assert router.stdout is not None
        await router.stdout.readline()
        times = ("--seconds", str(seconds + 12))
        first = ("cars", endpoint, "--first", "0", "--cars", str(half), *times)
        second = ("cars", endpoint, "--first", str(half), "--cars", str(cars - half), *times)
        people = ("viewers", endpoint, "--viewers", str(viewers), "--cars", str(cars), "--seconds", str(seconds))
        async with child(*me, *first) as one, child(*me, *second) as other:
            await asyncio.sleep(6.0)
            async with child(*me, *people) as watching:
                seen = json.loads((await watching.communicate())[0])
            came = [json.loads((await process.communicate())[0]) for process in (one, other)]
    ages_ms = np.array([age_s * 1000 for part in came for age_s in part["ages_s"]])
    sent, arrived = sum(seen["sent"]), sum(number for part in came for number in part["came"])
    heard = [number / seconds for number in seen["heard"]]
    said = (
        f"{cars} cars, {viewers} viewers, {seconds:g} s: {arrived:.0f} of {sent:.0f} commands arrived;"
        f" age p50 {np.percentile(ages_ms, 50):.1f}, p99 {np.percentile(ages_ms, 99):.1f}, max {ages_ms.max():.0f} ms;"
        f" samples per viewer {np.median(heard):.0f} /s (the one with all: {heard[0]:.0f});"
        f" cars seen {min(seen['seen']):.0f} to {max(seen['seen']):.0f}"
    )
    print(said)  # noqa: T201 - its output


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--as", dest="role", nargs=2, default=("", ""))
    parser.add_argument("--cars", type=int, default=200)
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    role, endpoint = options.role
    if role == "cars":
        figures = asyncio.run(publish(endpoint, options.first, options.cars, options.seconds))
    elif role == "viewers":
        figures = asyncio.run(view(endpoint, options.viewers, options.cars, options.seconds))
    else:
        asyncio.run(measure(options.cars, options.viewers, min(options.seconds, 40.0)))
        return
    sys.stdout.write(json.dumps(figures))


if __name__ == "__main__":
    main()
