"""A drive or a recording in virtual time, behind a link that delays the lidar's bytes: real drivers, tasks and laws."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final
from unittest import mock

import numpy as np
import numpy.typing as npt

from tests.system.soak.scene import MemoryLidar
from wallride.drivers.api import Scan
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.link import ByteLink
from wallride.runtime.app import Car
from wallride.runtime.ending import end
from wallride.runtime.settings.tree import Settings
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

PERIOD_S: Final = 0.025
NO_RETURN_MM: Final = 65533
MOVES_MPS: Final = 0.1
STANDS_MPS: Final = 0.02
RETURN_M: Final = 0.05


@dataclass(frozen=True)
class Constant:
    """Late by the same, from a moment on."""

    late_s: float
    from_s: float = 0.0

    def __call__(self, now_s: float) -> float:
        return self.late_s if now_s >= self.from_s else 0.0


@dataclass(frozen=True)
class Growing:
    """Later and later, by seconds a second."""

    rate: float
    from_s: float = 2.0

    def __call__(self, now_s: float) -> float:
        return self.rate * max(0.0, now_s - self.from_s)


@dataclass(frozen=True)
class Stepping:
    """Later by a step after each period."""

    step_s: float
    every_s: float = 2.0

    def __call__(self, now_s: float) -> float:
        return self.step_s * (now_s // self.every_s)


@dataclass(frozen=True)
class Jitter:
    """Another delay for each scan, within a limit."""

    most_s: float
    seed: int = 1

    def __call__(self, now_s: float) -> float:
        return float(np.random.default_rng((self.seed, round(now_s * 1e4))).uniform(0.0, self.most_s))


@dataclass(frozen=True, slots=True)
class LateDrive:
    """What is driven. late_s: delay of the bytes that leave the sensor at a time. timeless: TM is not answered."""

    world: str
    speed_mps: float
    late_s: Callable[[float], float]
    duration_s: float = 14.0
    timeless: bool = False
    seed: int = 1


@dataclass(slots=True)
class Drive:
    """What came of it. stops: how often the moving car came to stand. messages: what the lidar's health said."""

    contact_mps: float | None = None
    ended_s: float = 0.0
    way_m: float = 0.0
    stops: int = 0
    reasons: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    scans: int = 0
    counts: dict[str, int] = field(default_factory=dict)


@dataclass(slots=True)
class Delivery:
    """What the driver made of a recording. oldest_s: of the scans that it delivered, by their true age.

    younger_s: by how much a scan was told to be younger than it was, at most. gap_s: longest time without a scan after
    the first one.
    """

    delivered: int = 0
    oldest_s: float = 0.0
    younger_s: float = 0.0
    gap_s: float = 0.0


def deliver_late(ranges_m: npt.NDArray[np.float32], late_s: Callable[[float], float]) -> Delivery:
    """Send recorded scans (n, 1081) through the late link, one each PERIOD_S."""
    return run_virtual(_deliver(ranges_m, late_s))


async def _deliver(ranges_m: npt.NDArray[np.float32], late_s: Callable[[float], float]) -> Delivery:
    clock, found = asyncio.get_running_loop().time, Delivery()
    scip = MemoryLidar(clock=clock, seed=1)
    taken_s: dict[bytes, float] = {}
    last_s = math.nan

    def on_scan(scan: Scan) -> None:
        nonlocal last_s
        age_s = clock() - taken_s[_key(np.asarray(scan.ranges_m))]
        found.delivered += 1
        found.oldest_s = max(found.oldest_s, age_s)
        found.younger_s = max(found.younger_s, age_s - (clock() - scan.stamp_s))
        found.gap_s = max(found.gap_s, 0.0 if math.isnan(last_s) else clock() - last_s)
        last_s = clock()

    async def open_link(address: Any, clock: Any, **_: Any) -> ByteLink:
        ours = scip.connect()
        return ByteLink(address, ours.fileno(), lambda _lost: ours.close(), clock)

    with mock.patch("wallride.drivers.lidar.open_link", open_link):
        lidar = Hokuyo(HokuyoSettings(address="tcp://127.0.0.1:1"), clock=clock)
        running = asyncio.get_running_loop().create_task(lidar.run(on_scan))
        for number, row_m in enumerate(ranges_m):
            await asyncio.sleep((number + 1) * PERIOD_S - clock())
            far = ~((row_m >= 0.02) & (row_m <= 30.0))
            reported_mm = np.where(far, NO_RETURN_MM, np.round(row_m * 1000)).astype(np.int64)
            taken_s[_key(np.where(far, np.nan, reported_mm / 1000))] = clock()
            scip.late_s = late_s(clock())
            scip.publish(reported_mm, round(clock() * 1000))
        await asyncio.sleep(max(1.0, scip.late_s))
        await end(running)
    scip.close()
    return found


def _key(ranges_m: npt.NDArray[Any]) -> bytes:
    return bytes(np.round(np.nan_to_num(ranges_m, nan=0.0)[::7] * 1000).astype(np.int32))


def drive_late(what: LateDrive) -> Drive:
    """Drive it to its end or its first contact."""
    return run_virtual(_Stage(what).drive())


class _Stage:
    def __init__(self, what: LateDrive) -> None:
        self._what = what
        self._found = Drive()
        self._stop = asyncio.Event()
        self._was_moving = False

    async def drive(self) -> Drive:
        what, clock = self._what, asyncio.get_running_loop().time
        self._twin = twin = TwinWorld(load_world(what.world), clock, seed=what.seed)
        self._scip = scip = MemoryLidar(clock=clock, seed=what.seed)
        scip.sensor.unanswered = frozenset({"TM0"} if what.timeless else ())
        settings = Settings.model_validate(
            {
                "car": {"name": "sim"},
                "motor": {"servo_min": 0.1, "servo_max": 0.95},
                "lidar": {"address": "tcp://127.0.0.1:1"},
                "wall_follow": {"speed_mps": what.speed_mps},
                "battery": {"settle_s": 0},
                "recording": {"enabled": False},
                "process": {"state_folder": ""},
                "operator": {"permit": "always"},
            }
        )

        async def open_link(address: Any, clock: Any, **_: Any) -> ByteLink:
            end = scip.connect()
            return ByteLink(address, end.fileno(), lambda _lost: end.close(), clock)

        with mock.patch("wallride.drivers.lidar.open_link", open_link):
            assert isinstance(settings.lidar, HokuyoSettings)
            self._lidar = Hokuyo(settings.lidar, clock=clock)
            self._car = Car(settings, self._lidar, WorldMotor(twin, clock), MemoryBus(clock, listened_to=False), clock)
            turning = asyncio.get_running_loop().create_task(self._turn())
            asyncio.get_running_loop().call_at(what.duration_s, self._stop.set)
            await self._car.drive(self._stop)
            turning.cancel()
        scip.close()
        found = self._found
        found.contact_mps, found.way_m, found.ended_s = twin.contact_mps, twin.way_m, clock()
        found.counts = self._lidar.health.counts
        return found

    async def _turn(self) -> None:
        clock, twin, scans = asyncio.get_running_loop().time, self._twin, 0
        while not self._stop.is_set():
            scans += 1
            await asyncio.sleep(scans * PERIOD_S - clock())
            now_s = clock()
            ranges_m = twin.ranges_at(now_s)
            self._scip.late_s = self._what.late_s(now_s)
            self._scip.publish(
                np.where(np.isnan(ranges_m), NO_RETURN_MM, np.round(ranges_m * 1000)).astype(np.int64),
                round(now_s * 1000),
            )
            self._note()

    def _note(self) -> None:
        found, speed_mps = self._found, abs(self._twin.vehicle.speed_mps)
        message = self._lidar.health.message
        if not found.messages or found.messages[-1] != message:
            found.messages.append(message)
        if speed_mps > MOVES_MPS:
            self._was_moving = True
        elif speed_mps < STANDS_MPS and self._was_moving:
            self._was_moving = False
            found.stops += 1
            output = self._car.mux.output
            found.reasons.append(output.decision.reason if output is not None else "")
        if self._twin.contact_mps is not None:
            self._stop.set()
