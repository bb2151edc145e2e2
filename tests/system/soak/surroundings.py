"""What both soaks have around the car: a scene behind emulated devices, an operator, an injector and the oracle."""

import asyncio
import random
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final

from tests.system.soak.faults import Injector
from tests.system.soak.findings import Findings
from tests.system.soak.operator import SEND_PERIOD_S, Operator
from tests.system.soak.oracle import Oracle
from tests.system.soak.scene import SCAN_PERIOD_S, Scene, WitnessedVesc
from wallride.drivers.api import Clock
from wallride.runtime.wire.teleop import Press
from wallride.sim.devices.scip import ScipEmulator

AUTO_MPS: Final = 1.5
FIRST_FAULT_S: Final = 5.0
VESC_TIMEOUT_S: Final = 0.15
VESC_TIMEOUT_A: Final = 10.0


class SoakSurroundings(ABC):
    """One car's surroundings; a subclass has the car, carries an operator's commands to it, and can block it."""

    def __init__(
        self, clock: Clock, lidar: ScipEmulator, vesc: WitnessedVesc, oracle: Callable[[Scene], Oracle],
        seed: int, mean_pause_s: float,
    ) -> None:  # fmt: skip
        rng = random.Random(seed)
        self._clock = clock
        self.lidar, self.vesc = lidar, vesc
        self.scene = Scene(lidar, vesc, clock, seed)
        self.oracle = oracle(self.scene)
        self.operator = Operator(self._deliver, rng, session=rng.getrandbits(32) | 1)
        self.injector = Injector(self, rng, mean_pause_s)
        self.oracle.context = lambda: f"[{', '.join(self.injector.active)}]"
        self.touches: list[str] = []
        self.scene.touched = self._note_contact
        vesc.witness = self.oracle.motor
        vesc.opened = self.oracle.opened
        vesc.hung_up = lambda: self.oracle.hung_up(clock())

    @abstractmethod
    def carry(self, payload: bytes) -> None:
        """Carry an operator's command to the car."""

    @abstractmethod
    def block(self, for_s: float) -> None:
        """Keep the car's process from doing anything for a time."""

    def hear(self, beat: bytes) -> None:
        """Take in a beat of the car."""
        self.oracle.beat(self._clock(), self.operator.hear(beat))

    def unplug_motor(self, *, power: bool) -> None:
        """Pull the motor controller's cable, or its power as well."""
        self.vesc.unplug()
        if power:
            self.vesc.reboot()

    def replug_motor(self) -> None:
        """Put it back."""
        self.vesc.start()

    async def turn_lidar(self) -> None:
        """Move the world on and send scans, for ever."""
        await at_a_rate(SCAN_PERIOD_S, self._clock, self.scene.step)

    async def operate(self) -> None:
        """Send the operator's commands, for ever."""
        await at_a_rate(SEND_PERIOD_S, self._clock, lambda: self.operator.step(self._clock()))

    def fault(self, words: str, *details: str) -> None:
        """Note a violation that is not a command's."""
        self.oracle.violations[words] += 1
        self.oracle.kept += details

    def findings(self, seconds: float) -> Findings:
        """Return what was found in so many seconds."""
        oracle = self.oracle
        return Findings(
            seconds, dict(oracle.violations), oracle.kept, oracle.commands, oracle.moving, self.injector.counts,
            self.scene.way_m, self.scene.contacts, self.touches,
        )  # fmt: skip

    def _note_contact(self) -> None:
        speed_mps, demand = self.scene.vehicle.speed_mps, self.vesc.demand(self._clock())
        self.touches.append(
            f"{self._clock():10.3f} s  contact at {speed_mps:.2f} m/s, the motor's demand {demand.kind}"
            f" {demand.value:.0f}, held: {self.operator.wants.name or 'nothing'} {self.oracle.context()}"
        )

    def _deliver(self, payload: bytes, flags: Press, echo: int, speed_mps: float) -> None:
        self.oracle.delivered(self._clock(), int(flags), echo, speed_mps)
        self.carry(payload)


async def at_a_rate(period_s: float, clock: Clock, job: Callable[[], None]) -> None:
    """Call a job at a steady rate; what a blocked process missed is not made up for."""
    next_s = clock()
    while True:
        next_s = max(next_s + period_s, clock())
        await asyncio.sleep(max(0.0, next_s - clock()))
        job()
