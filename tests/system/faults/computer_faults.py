"""Faults of the computer and of the process on it: what is taken from the unmodified process while it drives."""

import asyncio
import resource
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path

from tests.system.bench import BLOCKED_MM, CORRIDOR_MM, Bench

HOG = "while True: pass"
HOGS: list[subprocess.Popen[bytes]] = []
HELD_BY_BLOCK_B = 1 << 20
"""Memory that the process may still take under pressure [byte]: less than any arena of its allocator."""


def stopped_for(seconds: float) -> Callable[[Bench], Awaitable[None]]:
    """Return an injector that stops the whole process for a time, as a blocked event loop does."""

    async def inject(car: Bench) -> None:
        car.runtime.kill(signal.SIGSTOP)
        await asyncio.sleep(seconds)

    return inject


def paused_for(seconds: float) -> Callable[[Bench], Awaitable[None]]:
    """Return an injector that stops the whole process for a time and lets it go on."""
    stop = stopped_for(seconds)

    async def inject(car: Bench) -> None:
        await stop(car)
        go_on(car)

    return inject


def go_on(car: Bench) -> None:
    """Let a stopped process go on."""
    car.runtime.kill(signal.SIGCONT)


def shift_wall_clock(car: Bench) -> None:
    """Let the computer's wall clock jump a day ahead, as `shifted_clock` reads it."""
    car.runtime.kill(signal.SIGWINCH)


def drop_lidar(car: Bench) -> None:
    """Pull the lidar's cable."""
    car.scip.refuse()
    car.scip.disconnect()


def take_descriptors(car: Bench) -> None:
    """Leave the process without a free descriptor, and drop its lidar."""
    used = len(list(Path(f"/proc/{car.runtime.pid}/fd").iterdir()))
    resource.prlimit(car.runtime.pid, resource.RLIMIT_NOFILE, (used, 4096))
    drop_lidar(car)


def give_descriptors(car: Bench) -> None:
    """Give them back, and the lidar."""
    resource.prlimit(car.runtime.pid, resource.RLIMIT_NOFILE, (4096, 4096))
    car.scip.listen_again()


def take_memory_and_drop_lidar(car: Bench) -> None:
    """Refuse the process any more memory from the kernel, and drop its lidar: connecting again needs memory."""
    pages = int(Path(f"/proc/{car.runtime.pid}/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + HELD_BY_BLOCK_B
    resource.prlimit(car.runtime.pid, resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
    drop_lidar(car)


def give_memory(car: Bench) -> None:
    """Give it back, and the lidar."""
    resource.prlimit(car.runtime.pid, resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    car.scip.listen_again()


def fill_disk_and_block(car: Bench) -> None:
    """Refuse every write to a file from now on, and put a wall ahead."""
    resource.prlimit(car.runtime.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
    car.scan_mm = BLOCKED_MM


def empty_disk_and_clear(car: Bench) -> None:
    """Undo it."""
    resource.prlimit(car.runtime.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    car.scan_mm = CORRIDOR_MM


def hog_and_block(car: Bench) -> None:
    """Keep both processors busy, and put a wall ahead."""
    HOGS.extend(subprocess.Popen([sys.executable, "-c", HOG]) for _ in range(4))
    car.scan_mm = BLOCKED_MM


def unhog_and_clear(car: Bench) -> None:
    """Undo it."""
    for hog in HOGS:
        hog.kill()
        hog.wait()
    HOGS.clear()
    car.scan_mm = CORRIDOR_MM
