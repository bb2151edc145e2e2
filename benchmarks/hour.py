"""An hour of driving by the unmodified tasks in virtual time: does memory grow, does the garbage collector stop us?

Run: python benchmarks/hour.py [--hours 1]

The car laps the loop at 3 m/s with all of its telemetry wanted; devices and bus are in memory, the world is simulated
(`wallride.sim.twin_world`). As in `wallride run` the hot functions are compiled and everything is frozen
once the car has set off. Memory is the private and shared pages of this process (RSS), simulator included; a collection
of generation 2 would block the loop for milliseconds.
"""

import argparse
import asyncio
import gc
import time
from collections import Counter
from pathlib import Path

import numpy as np

from wallride.runtime import kernel
from wallride.runtime.app import Car
from wallride.runtime.settings.tree import Settings
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world

SETTLED_S, MINUTE_S = 120.0, 60.0
SAMPLES = 12
MIB = 2**20
PAGE_BYTES = 4096


class CountingBus(MemoryBus):
    """Subscribes to everything, and keeps only the count."""

    messages = 0

    def put(self, key: str, payload: bytes, *, encoding: str = "", urgent: bool = False) -> None:  # noqa: ARG002 - a Bus
        """Count the message."""
        self.messages += 1


def main() -> None:
    """Drive, and print a line now and then."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hours", type=float, default=1.0)
    hours = parser.parse_args().hours
    print(kernel.state().words)
    print(f"{'s':>6}{'RSS MiB':>9}{'way m':>9}{'messages':>10}   collections of generation 0, 1, 2")
    began_s = time.process_time()
    memory_mib, collections, touched = run_virtual(drive(3600.0 * hours))
    slope = np.polyfit(np.linspace(0, hours, len(memory_mib)), memory_mib, 1)[0]
    print(
        f"{slope:+.2f} MiB an hour; {collections[2]} collections of generation 2; "
        f"{'touched something' if touched else 'touched nothing'}; {time.process_time() - began_s:.0f} s of a core"
    )


async def drive(seconds: float) -> tuple[list[float], Counter[int], bool]:
    """Return memory at even times, collections by generation, and whether anything was touched."""
    loop = asyncio.get_running_loop()
    twin = TwinWorld(load_world("loop"), loop.time, lidar=LidarSettings(noise_std_m=0.02, outlier_share=0.02), seed=7)
    settings = Settings.model_validate(
        {"battery": {"settle_s": 0.0}, "operator": {"permit": "always"}, "wall_follow": {"speed_mps": 3.0}}
    )
    ear = CountingBus(loop.time)
    motor = WorldMotor(twin, loop.time)
    car = Car(settings, WorldLidar(twin, loop.time), motor, ear, loop.time)
    stop = asyncio.Event()
    driving = loop.create_task(car.drive(stop))
    await asyncio.sleep(SETTLED_S)
    collections: Counter[int] = Counter()
    gc.collect()
    gc.freeze()
    gc.callbacks.append(lambda phase, info: collections.update([info["generation"]] if phase == "stop" else []))
    memory_mib = []
    for sample in range(SAMPLES + 1):
        memory_mib.append(rss_mib())
        of_each = ", ".join(str(collections[generation]) for generation in range(3))
        print(f"{loop.time():6.0f}{memory_mib[-1]:9.1f}{twin.way_m:9.0f}{ear.messages:10}   {of_each}", flush=True)
        until_s = loop.time() + seconds / SAMPLES
        while sample < SAMPLES and loop.time() < until_s:
            await asyncio.sleep(min(MINUTE_S, until_s - loop.time()))
            motor.wire.clear()  # the emulated motor records every command
    gc.callbacks.pop()
    stop.set()
    await driving
    return memory_mib, collections, twin.contact_mps is not None


def rss_mib() -> float:
    """Return the resident memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_BYTES / MIB


if __name__ == "__main__":
    main()
