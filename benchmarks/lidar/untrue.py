"""How far the car goes on by a lidar that tells no truth. Run: python -m benchmarks.lidar.untrue [--lidars x2,a2].

The whole car in virtual time by each emulated lidar's bytes (the UST-10LX's scans), at 1 m/s, noise of 10 mm, 0.5 %
outliers, a VESC. Metres from the fault to standstill; the faults come after 2.5 m in `l_turn`, a turned lidar is so
from the start, there and in `dead_end`. "touched": at so many m/s, with exit code 1; "drives": it never stood.
"""

import argparse
import asyncio
import logging
import math
import sys
from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks.lidars import BEAMS, LIDARS
from tests.system.pwm_drive import TurningMemoryLidar
from tests.system.timed_drive import drive_for
from wallride.drivers.api import Scan
from wallride.runtime.app import Car
from wallride.runtime.settings.tree import Settings
from wallride.sim.devices.lidar_kinds import HOKUYO, assignments
from wallride.sim.devices.turning import Floats, Millimetres, See, TurningDevice, TurningHead
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.turning_sensor import TurningSensor
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

FAULTS: Final = ("noisy", "flickering", "second", "again", "silent", "standing", "covered", "90", "180")
FAULT_AFTER_M: Final = 2.5
SPEED_MPS: Final = 1.0
DRIVEN_S: Final = 14.0
COVER_MM: Final = 30
NOISE_MM: Final = 3
FLICKER_MM: Final = 500
NOWHERE_MM: Final = 65_000
ROUNDED: Final = 1e-9
STANDS_MPS: Final = 0.02
TURNED_DEG: Final = {"90": 90.0, "180": 180.0}
SENT: Final = frozenset({*TURNED_DEG, "silent", "standing"})
"""Faults of which the distances know nothing."""


class UntrueTurns:
    """Turns (mm, `size` places each) as a lidar keeps them, and shows them again once the fault has begun."""

    def __init__(self, fault: str, size: int, turns_hz: float) -> None:
        self.fault, self.began = fault, False
        self._kept_mm = np.zeros((round(turns_hz) if fault == "second" else 1, size), np.int64)

    def shown(self, turns: Floats, mm: Millimetres) -> Millimetres:
        """Return what the lidar tells in place of mm, (n,), measured at turns of its head, whole ones and a part."""
        kept_mm = self._kept_mm
        number = (turns + ROUNDED).astype(np.intp)
        place = number % len(kept_mm), ((turns + ROUNDED) % 1.0 * kept_mm.shape[1]).astype(np.intp)
        if not self.began or self.fault in SENT:
            kept_mm[place] = mm
            return mm
        if self.fault == "covered":
            return np.full_like(mm, COVER_MM)
        again_mm = kept_mm[place]
        if self.fault == "noisy":
            noise_mm = np.random.default_rng(int(turns[0] * 1000)).integers(-NOISE_MM, NOISE_MM + 1, mm.size)
            again_mm = np.where((again_mm > 0) & (again_mm < NOWHERE_MM), again_mm + noise_mm, again_mm)
        if self.fault == "flickering":
            again_mm = again_mm + FLICKER_MM * ((place[1] == kept_mm.shape[1] // 3) & (number % 2 == 1))
        return again_mm


class UntrueHead(TurningHead):
    """The head of a turning lidar that shows such turns."""

    def __init__(self, device: TurningDevice, fault: str) -> None:
        super().__init__(device)
        self.turns = UntrueTurns(fault, self._before.size, device.turns_hz)

    def _measured(self, turns: Floats, head_deg: Floats, see: See) -> Millimetres:
        return self.turns.shown(turns, super()._measured(turns, head_deg, see))


class UntrueDrive:
    """One drive. way_m: from the fault on, or from the start for a turned lidar. reason: why the car stood at last."""

    def __init__(self, word: str, fault: str, world: str, seed: int) -> None:
        self._word, self._fault, self._world, self._seed = word, fault, load_world(world, seed=seed), seed
        yaw_rad = math.radians(TURNED_DEG.get(fault, 0.0))
        self._beams = BEAMS.model_copy(update={"mount_yaw_rad": yaw_rad})  # unchecked: no honest mount is so wrong
        self._fault_m = 0.0
        run_virtual(self._drive())

    def __str__(self) -> str:
        """Return the way, and what was touched."""
        touched = f" touched at {self.contact_mps:.2f}" if self.contact_mps > STANDS_MPS else ""
        stands = "" if self._stands else " drives"
        return f"{self.way_m:.2f}{stands}{touched}"

    async def _drive(self) -> None:
        clock = asyncio.get_running_loop().time
        settings = Settings.model_validate({
            "lidar": dict(one.removeprefix("lidar.").split("=") for one in assignments(self._word)),
            "operator": {"permit": "always"},
            "wall_follow": {"speed_mps": SPEED_MPS},
            "telemetry": {"enabled": False},
            "battery": {"settle_s": 0},
            "recording": {"enabled": False},
        })  # fmt: skip
        self._twin = TwinWorld(self._world, clock, lidar=self._beams, seed=self._seed)
        self._motor = WorldMotor(self._twin, clock)
        lidar = self._hokuyo() if self._word == HOKUYO else self._turning(settings)
        car = Car(settings, lidar, self._motor, MemoryBus(clock), clock)
        await drive_for(DRIVEN_S, car, self, [])
        self.reason = car.mux.output.decision.reason
        self.way_m = self._twin.way_m - (0.0 if self._fault in TURNED_DEG else self._fault_m)
        self.contact_mps = self._twin.contact_mps or 0.0
        self._stands = abs(self._twin.vehicle.speed_mps) < STANDS_MPS

    def _hokuyo(self) -> WorldLidar:
        size, clock = self._beams.beams, asyncio.get_running_loop().time
        turns, lidar = UntrueTurns(self._fault, size, self._beams.rate_hz), WorldLidar(self._twin, clock)

        def cover(reported_mm: Millimetres, now_s: float) -> Millimetres:
            self._begin(turns)
            lidar.frozen = turns.began and self._fault == "again"
            if turns.began and self._fault in {"silent", "standing"}:
                lidar.pull()
            return turns.shown(round(now_s * self._beams.rate_hz) + np.arange(size) / size, reported_mm)

        self._twin.cover = cover
        return lidar

    def _turning(self, settings: Settings) -> TurningMemoryLidar:
        rng = np.random.default_rng(self._seed)
        sensor = TurningSensor(self._word, self._beams, settings.car, lambda: self._motor.state, rng)
        sensor.head = head = UntrueHead(sensor.head.device, self._fault)
        clock = asyncio.get_running_loop().time

        def measure() -> list[Scan]:
            self._twin.advance()
            self._begin(head.turns)
            head.blocked = head.turns.began and self._fault == "standing"
            if head.turns.began and self._fault == "silent":
                return []
            return sensor.measure(clock(), self._world, self._twin.vehicle.pose)

        return TurningMemoryLidar(measure, sensor.health)

    def _begin(self, turns: UntrueTurns) -> None:
        """Begin with the fault when it is due."""
        if not turns.began and self._twin.way_m >= FAULT_AFTER_M:
            turns.began, self._fault_m = True, self._twin.way_m


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive all, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--lidars", default=",".join(LIDARS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reasons", action="store_true", help="also say why the car stood, drive by drive")
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    print(f"| lidar | {' | '.join(FAULTS)} |")
    touched = False
    for word in options.lidars.split(","):
        drives = {fault: _driven(word, fault, options.seed) for fault in FAULTS}
        print(f"| {word} | {' | '.join(', '.join(map(str, ones)) for ones in drives.values())} |", flush=True)
        if options.reasons:
            print(*(f"    {fault}: {one.reason}" for fault, ones in drives.items() for one in ones), sep="\n")
        touched = touched or any(one.contact_mps > STANDS_MPS for ones in drives.values() for one in ones)
    return int(touched)


def _driven(word: str, fault: str, seed: int) -> list[UntrueDrive]:
    if fault not in TURNED_DEG:
        return [UntrueDrive(word, fault, "l_turn", seed)]
    return [UntrueDrive(word, fault, world, seed) for world in ("l_turn", "dead_end")]


if __name__ == "__main__":
    sys.exit(main())
