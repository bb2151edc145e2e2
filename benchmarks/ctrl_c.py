"""Ctrl-C at random moments, from the start of the process on: how long does each command take to end?

Run: python -m benchmarks.ctrl_c [--moments 200] [--load 2] [--only monitor,run] [--seed 1]

A car with emulated devices runs beside all of them; `run` and `sim` have devices of their own. Each process gets a
terminal and one SIGINT after 0.05 to 6 s; the monitor's page is open in a browser's place by then. Exit code 1 where
one took longer than LIMIT_S, or had to be killed: it prints what that process wrote, and how much of the processors
it had in that time; the rest it waited.
"""

import argparse
import asyncio
import contextlib
import math
import multiprocessing
import os
import pty
import random
import re
import resource
import signal
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import aiohttp

from wallride.runtime.wire.ports import free_endpoint

LIMIT_S: Final = 1.0
KILLED_AFTER_S: Final = 30.0
MOMENTS_S: Final = (0.05, 6.0)
PAGE: Final = re.compile(rb"http://[\w.:]+/\?token=\w+")
DRIVING: Final = (
    "--set", "operator.permit=always", "--set", "battery.settle_s=0", "--set", "recording.enabled=false",
    "--set", "wall_follow.speed_mps=1.0", "--set", "parameters.history_file=",
)  # fmt: skip


@dataclass(frozen=True)
class Ending:
    """How a process ended. computed_s: time of the processors from the signal on. said: what it wrote."""

    command: str
    delay_s: float
    took_s: float
    computed_s: float
    code: int
    said: bytes

    @property
    def is_late(self) -> bool:
        """Tell whether the user had to wait, or the process crashed."""
        return self.took_s > LIMIT_S or (self.code < 0 and -self.code != signal.SIGINT)


def commands(car: str, own: str) -> dict[str, list[str]]:
    """Return the arguments of each long-running command. car: endpoint of the car; own: settings of other devices."""
    at = ["--connect", car]
    return {
        "monitor": ["monitor", "--no-browser", "--port", "0", *at],
        "teleop": ["teleop", "--keyboard", *at],
        "run": ["run", own, *DRIVING, "--set", "telemetry.any_port=true"],
        "sim": ["sim", "loop", "--headless", "--duration", "600", *DRIVING],
        "foxglove": ["foxglove", "--port", "0", *at],
        "status": ["status", "--watch", *at],
        "cars": ["cars", "--watch", *at],
        "race": ["race", *at],
        "echo": ["topic", "echo", "scan", *at],
        "hz": ["topic", "hz", "scan", *at],
        "router": ["router", "--listen", free_endpoint()],
    }


async def main() -> int:
    """Interrupt one process after the other, print a table; 1 when one was late."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--moments", type=int, default=200, metavar="N", help="over all commands together")
    parser.add_argument("--load", type=int, default=os.cpu_count(), metavar="N", help="processes that only compute")
    parser.add_argument("--only", type=lambda text: text.split(","), help="these commands, separated by commas")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it, and its children too
    chance = random.Random(options.seed)
    ends: dict[str, list[Ending]] = defaultdict(list)
    with tempfile.TemporaryDirectory(prefix="wallride-") as folder, computing(options.load):
        async with car(Path(folder)) as (endpoint, own):
            offered = commands(endpoint, own)
            for moment in range(options.moments):
                name = list(options.only or offered)[moment % len(options.only or offered)]
                end = await interrupted(name, offered[name], chance.uniform(*MOMENTS_S))
                ends[name].append(end)
                if end.is_late:
                    print(
                        f"{name}: {end.took_s:.2f} s, of these {end.computed_s:.2f} s computing, interrupted after "
                        f"{end.delay_s:.2f} s, exit code {end.code}, load {os.getloadavg()[0]:.0f}"
                    )
                    print(end.said.decode(errors="replace")[-2000:], flush=True)
    print(f"{'':10}{'moments':>8}{'median s':>10}{'longest s':>10}{'late':>6}  exit codes")
    for name, of_one in ends.items():
        took = sorted(end.took_s for end in of_one)
        codes = ",".join(str(code) for code in sorted({end.code for end in of_one}))
        late = sum(end.is_late for end in of_one)
        print(f"{name:10}{len(took):8}{took[len(took) // 2]:10.2f}{took[-1]:10.2f}{late:6}  {codes}")
    return int(any(end.is_late for of_one in ends.values() for end in of_one))


@contextlib.asynccontextmanager
async def car(folder: Path) -> AsyncIterator[tuple[str, str]]:
    """Run a car with emulated devices, and other devices; yield the car's endpoint and the settings of the others."""
    endpoint = free_endpoint()
    async with contextlib.AsyncExitStack() as stack:
        for name in ("car", "own"):
            emulate = ["emulate", "loop", "--folder", str(folder / name), "--port", "0"]
            await stack.enter_async_context(child(emulate))
            while not (folder / name / "car.toml").exists():
                await asyncio.sleep(0.1)
        listening = f"telemetry.listen=['{endpoint}']"
        await stack.enter_async_context(child(["run", str(folder / "car" / "car.toml"), *DRIVING, "--set", listening]))
        yield endpoint, str(folder / "own" / "car.toml")


@contextlib.asynccontextmanager
async def child(arguments: list[str]) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run a command in the background; it is killed in the end."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "wallride", *arguments, stdout=asyncio.subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def interrupted(name: str, arguments: list[str], delay_s: float) -> Ending:
    """Start a command in a terminal, send SIGINT after a while, and wait for its end."""
    master, slave = pty.openpty()
    said = bytearray()
    loop = asyncio.get_running_loop()
    try:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "wallride", *arguments, stdin=slave, stdout=slave, stderr=slave, process_group=0
        )
        loop.add_reader(master, lambda: said.extend(os.read(master, 65536)))
        visit = asyncio.create_task(look_at(said)) if name == "monitor" else None
        await asyncio.sleep(delay_s)
        if process.returncode is not None:
            print(f"{name}: ended by itself within {delay_s:.2f} s, exit code {process.returncode}")
            return Ending(name, delay_s, math.inf, 0.0, process.returncode, bytes(said))
        begin_s, before_s = time.monotonic(), cpu_of_children_s() + cpu_of(process.pid)
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)
        try:
            async with asyncio.timeout(KILLED_AFTER_S):
                code = await process.wait()
        except TimeoutError:
            process.kill()
            code = await process.wait()
        took_s = time.monotonic() - begin_s
        if visit is not None:
            visit.cancel()
    finally:
        loop.remove_reader(master)
        os.close(master)
        os.close(slave)
    return Ending(name, delay_s, took_s, cpu_of_children_s() - before_s, code, bytes(said))


def cpu_of_children_s() -> float:
    """Return the processors' time of the children that have ended, with theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cpu_of(pid: int) -> float:
    """Return the processors' time of a process that runs, with its children's that have ended [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


async def look_at(said: bytearray) -> None:
    """Hold the page's web socket open from the moment at which the monitor names its address."""
    while not (found := PAGE.search(said)):
        await asyncio.sleep(0.02)
    base, _, query = found[0].decode().partition("?")
    with contextlib.suppress(aiohttp.ClientError):
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(f"{base}ws?{query}", origin=base.rstrip("/")) as page,
        ):
            async for _ in page:
                pass


@contextlib.contextmanager
def computing(number: int):  # noqa: ANN201
    """Let that many processes want a core."""
    burners = [multiprocessing.Process(target=burn, daemon=True) for _ in range(number)]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.join()


def burn() -> None:
    """Compute until killed."""
    while True:
        pass


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
