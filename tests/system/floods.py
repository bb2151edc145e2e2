"""What floods do to a car: the real `wallride run` between emulated devices, and clients that send without limit.

Run: python -m tests.system.floods [--seconds 5] [--runs 3] [--load] [--fifo | --main-nice -10] [FLOOD ...]

A FLOOD is KIND:WHO of `flooder`, several joined by "+". Each run starts the car, floods it for some seconds, presses
another operator's e-stop in the middle, and prints the longest time between two commands at the motor's port, the
growth of memory (RSS), and the time from the e-stop to the first brake at that port. --load: a busy loop on each core
besides. --fifo: the car's thread has SCHED_FIFO 20, as the service gives it. --main-nice: its niceness, as it asks for
where FIFO is refused. --net-nice: that of zenoh's threads that receive and send.

The devices and the clock that measures run in this process, with SCHED_FIFO where that is allowed: in a car they are
other machines. Everything stays on loopback and ends by itself.
"""

import argparse
import asyncio
import itertools
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from tests.system.bench import Bench, bench
from tests.system.socket_motor import SocketVesc
from wallride.clients.keys.folder import KeyFolder
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.teleop import Command, Input, Press
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, client_config

CAR = "sim"
ALL = (
    "nonsense:alice",
    "large:alice",
    "questions:bob",
    "large_questions:bob",
    "every_question:alice",
    "wild:here",
    "stranger:nobody",
    "nonsense:alice+questions:bob+stranger:nobody",
)
SETTLE_S = 1.0
PRESS_EVERY_S = 0.02


@dataclass(frozen=True)
class Figures:
    """Figures of one run: times [s], memory [bytes], and what the flooders printed."""

    gap_s: float
    stop_s: float
    grown_bytes: int
    sent: str


def make_keys(folder: Path) -> None:
    """Make the keys of the car, of two operators and of a viewer, all files in one folder."""
    now = datetime.now(UTC)
    keys = KeyFolder(folder)
    keys.begin(CAR, [], now, 30, renew=False)
    for name, role in (("alice", Role.OPERATOR), ("eve", Role.OPERATOR), ("bob", Role.VIEWER)):
        keys.add(Person(name, role), folder / "people" / name, now, 30, renew=False)
        for file in (folder / "people" / name).glob(f"{name}.*"):
            (folder / file.name).write_bytes(file.read_bytes())
            (folder / file.name).chmod(0o600)


def resident_bytes(pid: int) -> int:
    """Return the resident memory of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def favour(pid: int, names: tuple[str, ...], nice: int) -> list[str]:
    """Give the threads of a process whose names begin so this niceness; return their names."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        name = (task / "comm").read_text().strip()
        if name.startswith(names):
            os.setpriority(os.PRIO_PROCESS, int(task.name), nice)
            found.append(name)
    return found


async def flooded(
    flood: str, *, seconds: float, load: bool = False, fifo: bool = False, main_nice: int = 0, net_nice: int = 0
) -> Figures:
    """Run a car through one flood."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_keys(folder / "keys")
        here, away = free_endpoint(), free_endpoint().replace("tcp/", "tls/")
        settings = [
            "telemetry.enabled=true", f'telemetry.listen=["{here}", "{away}"]', f"telemetry.keys_dir={folder / 'keys'}",
            "recording.enabled=false",
        ]  # fmt: skip
        async with bench(folder, *settings, motor=SocketVesc, program="tests.system.socket_motor") as car:
            await car.until_driving()
            if fifo:
                os.sched_setscheduler(car.runtime.pid, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(20))
            eve = Bus(client_config(away, Tls(*(folder / "keys" / file for file in ("ca.pem", "eve.pem", "eve.key")))))
            await eve.open()
            hogs = [await _start("-c", f"import time\nt=time.time()+{seconds + 5}\nwhile time.time()<t: pass")
                    for _ in range(2 if load else 0)]  # fmt: skip
            await asyncio.sleep(SETTLE_S)
            if main_nice:
                os.setpriority(os.PRIO_PROCESS, car.runtime.pid, main_nice)
            if net_nice:
                favour(car.runtime.pid, ("rx-", "tx-", "net-"), net_nice)
            try:
                return await _measure(car, flood, here, away, folder / "keys", seconds, eve)
            finally:
                for hog in hogs:
                    if hog.returncode is None:  # they also end by themselves
                        hog.kill()
                    await hog.wait()
                await eve.close()


async def _measure(car: Bench, flood: str, here: str, away: str, keys: Path, seconds: float, eve: Bus) -> Figures:
    before = resident_bytes(car.runtime.pid)
    flooders = []
    for part in filter(None, flood.split("+")):
        kind, _, who = part.partition(":")
        place = here if who == "here" else away
        named = [str(keys), who] if who not in {"here", "nobody"} else []
        flooders.append(await _start("-m", "tests.system.flooder", kind, place, CAR, str(seconds), *named, said=True))
    began_s = time.monotonic() + 0.5
    most = before
    while time.monotonic() < began_s + seconds * 0.6:
        await asyncio.sleep(0.05)
        most = max(most, resident_bytes(car.runtime.pid))
    stop_s = await _press(car, eve)
    while time.monotonic() < began_s + seconds:
        await asyncio.sleep(0.05)
        most = max(most, resident_bytes(car.runtime.pid))
    said = [(await flooder.communicate())[0].decode().strip() for flooder in flooders]
    times = [at_s for at_s, _ in car.motor_commands(began_s - 0.5)]
    gap_s = max((after - at for at, after in itertools.pairwise(times)), default=seconds)
    return Figures(gap_s, stop_s, most - before, " ".join(said))


async def _press(car: Bench, eve: Bus) -> float:
    """Return the time from an operator's e-stop to the brake at the motor's port; it is sent as a client sends it."""
    pressed_s = time.monotonic()
    for sequence in range(100):
        command = Command(77, sequence + 1, 1, 1, Press.ESTOP, Input.KEYBOARD, 0, 0.0, 0.0, "eve")
        eve.put(topics.key(CAR, topics.COMMAND), command.pack(), urgent=True)
        due_s = pressed_s + (sequence + 1) * PRESS_EVERY_S
        while time.monotonic() < due_s:
            await asyncio.sleep(0.001)
        if car.first_brake_s(pressed_s) < time.monotonic():
            break
    return car.first_brake_s(pressed_s) - pressed_s


async def _start(*arguments: str, said: bool = False) -> asyncio.subprocess.Process:
    out = asyncio.subprocess.PIPE if said else asyncio.subprocess.DEVNULL
    return await asyncio.create_subprocess_exec(
        sys.executable, *arguments, stdout=out, stderr=asyncio.subprocess.DEVNULL
    )


def main() -> None:
    """Run the floods and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("flood", nargs="*", default=ALL)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--load", action="store_true")
    parser.add_argument("--fifo", action="store_true")
    parser.add_argument("--main-nice", type=int, default=0)
    parser.add_argument("--net-nice", type=int, default=0)
    options = parser.parse_args()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(30))
    except OSError as error:
        print(f"measured without real-time scheduling: {error.strerror}")
    print(f"{'flood':48}{'gap ms':>8}{'stop ms':>9}{'RSS MB':>8}  messages")
    for flood in options.flood:
        for _ in range(options.runs):
            took = asyncio.run(
                flooded(
                    flood,
                    seconds=options.seconds,
                    load=options.load,
                    fifo=options.fifo,
                    main_nice=options.main_nice,
                    net_nice=options.net_nice,
                )
            )
            figures = f"{took.gap_s * 1e3:8.0f}{took.stop_s * 1e3:9.0f}{took.grown_bytes / 1e6:8.1f}"
            print(f"{flood:48}{figures}  {took.sent}", flush=True)


if __name__ == "__main__":
    main()
