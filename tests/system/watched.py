"""A simulated car that is watched: `wallride sim --headless`, `wallride monitor` and Chromium, three processes.

What the car does is known from its telemetry, and afterwards, to the byte, from what it recorded of its motor's wire.
"""

import asyncio
import contextlib
import math
import os
import signal
import sys
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from tests.clients.monitor.browser import Browser, Page, chromium, needs_chromium
from tests.runtime.recording.reading import STORE, streamed
from wallride.clients.decoding import decode
from wallride.drivers.vesc.codec import Packet, VescDeframer
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.live.screen import address_in

CAR = "sim"
OPERATOR = "ann@laptop"
UP_WITHIN_S = 30.0
DOWN_WITHIN_S = 5.0
BYTES = "std_msgs/msg/UInt8MultiArray"


class Program:
    """A `wallride` command in a session of its own, so that its children end with it. log: its last lines.

    runtime: folder of the user's login, where the page's token is kept.
    """

    def __init__(self, *arguments: str, runtime: Path) -> None:
        self._arguments, self._runtime = arguments, runtime
        self._reading: asyncio.Task[None] | None = None
        self.process: asyncio.subprocess.Process
        self.log: deque[str] = deque(maxlen=200)

    async def start(self) -> None:
        """Start it, again if it has ended."""
        self.process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "wallride", *self._arguments, start_new_session=True,
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
            env={**os.environ, "XDG_RUNTIME_DIR": str(self._runtime)},
        )  # fmt: skip
        self._reading = asyncio.create_task(self._read())

    async def end(self, number: signal.Signals = signal.SIGTERM) -> None:
        """Ask it to end, and end what is left of it and its children."""
        if self._reading is None:
            return
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(number)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(DOWN_WITHIN_S):
                await self.process.wait()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        await self.process.wait()
        await self._reading

    async def _read(self) -> None:
        assert self.process.stdout is not None
        async for line in self.process.stdout:
            self.log.append(line.decode(errors="replace").rstrip())


class Watched:
    """Everything. output: the speeds that the car sent to its motor, with their arrival. status: its newest."""

    def __init__(self, folder: Path, endpoint: str, car: Program, monitor: Program) -> None:
        self.folder = folder
        self.car = car
        self.monitor = monitor
        self.output: deque[tuple[float, float]] = deque(maxlen=100_000)
        self.status: dict[str, Any] = {}
        self.page: Page
        self.browser: Browser
        self._bus = Bus(zenoh_config.client_config(endpoint, None))
        self._bus.subscribe(topics.key(CAR, topics.OUTPUT), self._on_output)
        self._bus.subscribe(topics.key(CAR, topics.STATUS), lambda _, text, __: self.status.update(topics.decode(text)))

    @property
    def speed_mps(self) -> float:
        """What the motor was asked for last."""
        return self.output[-1][1] if self.output else 0.0

    @property
    def url(self) -> str:
        """The page's address, with its token."""
        return address_in(self.monitor.log)

    async def listen(self) -> None:
        """Hear the car, which has to be there soon."""
        async with asyncio.timeout(UP_WITHIN_S):
            while not self.status:
                with contextlib.suppress(OSError):
                    if not self._bus.is_open:
                        await self._bus.open()
                await asyncio.sleep(0.1)

    async def until(self, condition: Callable[[], bool], what: str, within_s: float = 10.0) -> None:
        """Wait for something that must happen."""
        try:
            async with asyncio.timeout(within_s):
                while not condition():
                    await asyncio.sleep(0.005)
        except TimeoutError:
            said = "\n".join([*self.car.log, *self.monitor.log])
            raise AssertionError(f"never: {what}; {self.status.get('operator')}; {said}") from None

    async def open(self) -> Page:
        """Open the page in a new tab and wait until it shows the car."""
        self.page = await self.browser.open()
        await self.browser.show(self.page)
        await self.page.look(width=1280, height=900)
        await self.page.go(self.url)
        await self.page.until("window.wallride && wallride.timings.count > 3 && wallride.link.newest.beat.number > 0")
        return self.page

    async def take_control(self) -> None:
        """Switch Drive on; somebody who has just been lost is waited for."""
        await self.page.click("#drive")
        await self.page.until("document.querySelector('#pilot-state').textContent === 'ready'")

    async def drive_by_touch(self, speed_mps: float = 0.3) -> None:
        """Hold the drive pad and pull it up until the car drives."""
        x, y = await self.page.middle("#touch")
        for _ in range(4):
            await self.page.touch("touchStart", (x, y))
            await asyncio.sleep(0.1)
            for i in range(1, 6):
                await self.page.touch("touchMove", (x, y - 14 * i))
            with contextlib.suppress(AssertionError):  # the page stood still for a moment: the car wants a release
                await self.until(lambda: (self.status["speed_mps"] or 0) > speed_mps, "driving by touch", 3.0)
                return
            await self.page.touch("touchEnd")
            await asyncio.sleep(0.5)
        raise AssertionError(f"the touch does not drive the car; {self.status['operator']}")

    async def until_stopped(self, since_s: float) -> None:
        """Wait until the motor is told to stand."""
        await self.until(lambda: any(at_s > since_s and not mps for at_s, mps in self.output), "a stop", 3.0)

    def wire(self) -> "list[tuple[float, bytes]]":
        """Return (time, payload) of what was recorded of the bytes to the motor controller."""
        offset_ns, deframer, found = time.time_ns() - time.monotonic_ns(), VescDeframer(), []
        for file in sorted(self.folder.glob("*.mcap")):
            for topic, message in streamed(file.read_bytes()):
                if topic.endswith("raw/motor/out"):
                    at_s = (message.log_time - offset_ns) / 1e9
                    octets = bytes(STORE.deserialize_cdr(message.data, BYTES).data)
                    found += [(at_s, payload) for payload in deframer.feed(octets)]
        return found

    async def close(self) -> None:
        """Stop listening."""
        await self._bus.close()

    def _on_output(self, _key: str, payload: bytes, arrival_s: float) -> None:
        self.output.append((arrival_s, decode(topics.OUTPUT, payload)["drive"]["speed"]))


def brake_s(motor: "list[tuple[float, bytes]]", since_s: float) -> float:
    """Return how long after a moment the car braked; infinity when it did not."""
    braked = (at_s for at_s, payload in motor if at_s >= since_s and payload[0] == Packet.SET_CURRENT_BRAKE)
    return next(braked, math.inf) - since_s


def moves(motor: "list[tuple[float, bytes]]", since_s: float, until_s: float) -> int:
    """Return how often the motor was asked to turn."""
    return sum(
        since_s < at_s < until_s and payload[0] == Packet.SET_RPM and any(payload[1:]) for at_s, payload in motor
    )


@asynccontextmanager
async def watched(tmp_path: Path, world: str, *settings: str, longest_s: float = 120.0) -> AsyncIterator[Watched]:
    """Start everything on free ports; every process is ended on every way out."""
    needs_chromium()
    endpoint, port = free_endpoint(), int(free_endpoint().rpartition(":")[2])
    kept = tmp_path / "kept"
    assignments = [f"telemetry.listen={endpoint}", f"recording.folder={kept}", *settings]
    car = Program(
        "sim", world, "--headless", "--duration", str(longest_s),
        *(word for assignment in assignments for word in ("--set", assignment)), runtime=tmp_path,
    )  # fmt: skip
    monitor = Program(
        "monitor", "--no-browser", "--port", str(port), "--connect", endpoint, "--name", OPERATOR, runtime=tmp_path
    )
    scene = Watched(kept, endpoint, car, monitor)
    try:
        await car.start()
        await monitor.start()
        async with chromium(tmp_path / "profile") as scene.browser:
            await scene.listen()
            await scene.until(lambda: any("http://" in line for line in monitor.log), "the page's address")
            yield scene
    finally:
        await asyncio.gather(car.end(), monitor.end(), scene.close())
