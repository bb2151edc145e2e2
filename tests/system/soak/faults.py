"""Faults of a soak, begun and ended at random times, with what the oracle is told of each."""

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from tests.system.soak.operator import Operator
from tests.system.soak.oracle import Oracle
from tests.system.soak.scene import GOOD_VOLTAGE_V, Scene, covered, hand
from wallride.runtime.wire.teleop import Press

MEAN_PAUSE_S: Final = 10.0
FAULT_STOP_S: Final = 0.25
"""Time in which a fault that the controller has shown stops the car; it is latched until an operator's reset."""
SURELY_LOST_S: Final = 0.6
"""Duration of an outage that the car must have noticed: what was pressed before it moves nothing after it."""


class Soak(Protocol):
    """What a fault acts on."""

    scene: Scene
    operator: Operator
    oracle: Oracle

    def unplug_motor(self, *, power: bool) -> None:
        """Pull the motor controller's cable, or its power as well."""
        ...

    def replug_motor(self) -> None:
        """Put it back."""
        ...

    def block(self, for_s: float) -> None:
        """Keep the car's process from doing anything for a time."""
        ...


Act = Callable[[Soak], None]


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    lasts_s: shortest and longest duration. stop_s: bound of the stop while it lasts (docs/faults.md), None where the
    car may drive on. stop_m: way after which stop_s counts: a repeated scan is told from a measured one by the way.
    max_mps: speed that is allowed all the same. by_hand: a human is stopped, too. lost: the device counts as lost.
    """

    begin: Act
    end: Act = lambda _: None
    lasts_s: tuple[float, float] = (0.05, 3.0)
    stop_s: float | None = None
    stop_m: float = 0.0
    max_mps: float = 0.0
    by_hand: bool = True
    lost: bool = False


def scip(**switches: object) -> Act:
    """Return an act that sets switches of the emulated lidar."""
    return lambda soak: _set(soak.scene.scip, switches)


def vesc(**switches: object) -> Act:
    """Return an act that sets switches of the emulated motor controller."""
    return lambda soak: _set(soak.scene.vesc, switches)


def scene(**switches: object) -> Act:
    """Return an act that sets attributes of the scene."""
    return lambda soak: _set(soak.scene, switches)


def operator(**switches: object) -> Act:
    """Return an act that sets attributes of the operator."""
    return lambda soak: _set(soak.operator, switches)


def _set(owner: object, switches: Mapping[str, object]) -> None:
    for name, value in switches.items():
        setattr(owner, name, value)


def drop_lidar(soak: Soak) -> None:
    soak.scene.scip.refuse()
    soak.scene.scip.disconnect()


def hear_again(soak: Soak) -> None:
    soak.scene.vesc.forget_unread()
    soak.oracle.opened()  # what was written meanwhile is lost on the way: no silence of the car's
    soak.scene.vesc.deaf = False


def hold_back(soak: Soak) -> None:
    soak.operator.withheld = []


def both(*acts: Act) -> Act:
    """Return an act that does several."""

    def act(soak: Soak) -> None:
        for each in acts:
            each(soak)

    return act


def garbled(every: int | None) -> Act:
    return scip(garbage_every=every, bad_checksum_every=every)


FAULTS: Final[dict[str, Fault]] = {
    "lidar unplugged": Fault(drop_lidar, lambda soak: soak.scene.scip.listen_again(), lost=True),
    "lidar mute": Fault(scene(mute=True), scene(mute=False), lost=True),
    "lidar garbage": Fault(garbled(1), garbled(None), lost=True),
    "lidar bad checksums": Fault(scip(bad_checksum_every=1), scip(bad_checksum_every=None), lost=True),
    "lidar every third scan bad": Fault(garbled(3), garbled(None)),
    "lidar late burst": Fault(
        lambda soak: soak.scene.scip.stall(), lambda soak: soak.scene.release(), lasts_s=(0.05, 1.5)
    ),
    "lidar frozen": Fault(scip(frozen=True), scip(frozen=False), stop_s=0.05, stop_m=0.45, by_hand=False),
    "lidar covered": Fault(scene(cover=covered), scene(cover=None), stop_s=0.25, by_hand=False),
    "hand before the lidar": Fault(scene(cover=hand), scene(cover=None), stop_s=0.25, by_hand=False),
    "lidar clock ahead": Fault(scene(stamp_jump_ms=3_600_000), scene(stamp_jump_ms=0)),
    "lidar clock back": Fault(scene(stamp_jump_ms=-1_000), scene(stamp_jump_ms=0)),
    "motor unplugged": Fault(lambda soak: soak.unplug_motor(power=False), lambda soak: soak.replug_motor(), lost=True),
    "motor reboots": Fault(lambda soak: soak.unplug_motor(power=True), lambda soak: soak.replug_motor(), lost=True),
    "motor mute": Fault(vesc(silent=True), vesc(silent=False), stop_s=0.25, lost=True),
    "motor bad checksums": Fault(vesc(bad_crc=True), vesc(bad_crc=False), stop_s=0.25, lost=True),
    "motor garbage": Fault(vesc(garbage=True), vesc(garbage=False), stop_s=0.25, lost=True),
    "motor noise": Fault(vesc(noise=True), vesc(noise=False)),
    "motor deaf": Fault(vesc(deaf=True), hear_again, lost=True),
    "motor kill switch": Fault(vesc(kill_switch=True), vesc(kill_switch=False), stop_s=0.25),
    "motor fault": Fault(lambda soak: soak.scene.vesc.inject_fault(3), lasts_s=(0.5, 1.0)),
    "motor impossible speed": Fault(vesc(shown_erpm=10**6), vesc(shown_erpm=None), stop_s=0.25),
    "motor counter stopped": Fault(vesc(counter_stopped=True), vesc(counter_stopped=False)),
    "low battery": Fault(
        vesc(voltage_v=10.0), vesc(voltage_v=GOOD_VOLTAGE_V), lasts_s=(2.0, 6.0), stop_s=1.5, max_mps=1.0
    ),
    "empty battery": Fault(vesc(voltage_v=9.0), vesc(voltage_v=GOOD_VOLTAGE_V), lasts_s=(2.0, 6.0), stop_s=1.5),
    "absent battery": Fault(vesc(voltage_v=0.4), vesc(voltage_v=GOOD_VOLTAGE_V), lasts_s=(2.0, 4.0), stop_s=1.5),
    "operator lost": Fault(operator(silent=True), operator(silent=False)),
    "operator's link late": Fault(hold_back, lambda soak: soak.operator.release_withheld()),
    "operator's pad lost": Fault(operator(once=Press.UNSURE)),
    "operator lets go": Fault(operator(wants=Press(0)), operator(wants=Press.AUTONOMY)),
    "operator drives by hand": Fault(operator(wants=Press.MANUAL), operator(wants=Press.AUTONOMY)),
    "e-stop": Fault(operator(once=Press.ESTOP)),
    "process blocked 50 ms": Fault(lambda soak: soak.block(0.05)),
    "process blocked 200 ms": Fault(lambda soak: soak.block(0.2)),
    "process blocked 1 s": Fault(lambda soak: soak.block(1.0)),
    "both devices silent": Fault(
        both(scene(mute=True), vesc(silent=True)), both(scene(mute=False), vesc(silent=False)), stop_s=0.25, lost=True
    ),
}  # fmt: skip

GROUPS: Final = (
    {"lidar garbage", "lidar bad checksums", "lidar every third scan bad"},
    {"lidar covered", "hand before the lidar"},
    {"lidar clock ahead", "lidar clock back"},
    {"lidar frozen", "motor counter stopped"},
    {"lidar mute", "both devices silent", "motor mute"},
    {"motor unplugged", "motor reboots"},
    {"low battery", "empty battery", "absent battery"},
    {"operator lets go", "operator drives by hand"},
)
"""Faults that use the same switch, or of which one is found by what the other breaks: one at a time is active."""


class Injector:
    """Begins and ends faults at random times; `step` often. counts: how often each was begun."""

    def __init__(self, soak: Soak, rng: random.Random, mean_pause_s: float = MEAN_PAUSE_S) -> None:
        self.active: dict[str, float] = {}
        self.counts: dict[str, int] = dict.fromkeys(FAULTS, 0)
        self._soak = soak
        self._rng = rng
        self._mean_pause_s = mean_pause_s
        self._began_s: dict[str, float] = {}
        self._began_m: dict[str, float] = {}
        self._next_s: float | None = None
        soak.scene.vesc.fault_shown = lambda: soak.oracle.fault_shown(soak.scene.now_s, FAULT_STOP_S)

    def step(self, now_s: float) -> None:
        """End what is over, and begin what is due."""
        for name in [name for name, until_s in self.active.items() if now_s >= until_s]:
            self.end(name, now_s)
        for name in self.active:
            if (stop_m := FAULTS[name].stop_m) and self._soak.scene.way_m - self._began_m[name] > stop_m:
                self._forbid(name, now_s)
        if self._next_s is None:
            self._next_s = now_s + self._pause_s()
        elif now_s >= self._next_s:
            self._next_s = now_s + self._pause_s()
            busy = set(self.active).union(*(group for group in GROUPS if group & set(self.active)))
            self.begin(self._rng.choice([name for name in FAULTS if name not in busy]), now_s)

    def _pause_s(self) -> float:
        return self._rng.expovariate(1.0) * self._mean_pause_s

    def begin(self, name: str, now_s: float) -> None:
        """Begin one fault."""
        fault = FAULTS[name]
        self.counts[name] += 1
        self.active[name] = now_s + self._rng.uniform(*fault.lasts_s)
        self._began_s[name] = now_s
        self._began_m[name] = self._soak.scene.way_m
        if fault.stop_s is not None and not fault.stop_m:
            self._forbid(name, now_s)
        fault.begin(self._soak)

    def _forbid(self, name: str, now_s: float) -> None:
        fault, oracle = FAULTS[name], self._soak.oracle
        if fault.stop_s is not None:
            oracle.forbid(name, now_s, fault.stop_s, fault.max_mps, by_hand=fault.by_hand)

    def end(self, name: str, now_s: float) -> None:
        """End one fault."""
        fault, oracle = FAULTS[name], self._soak.oracle
        del self.active[name]
        fault.end(self._soak)
        oracle.allow(name)
        if fault.lost and now_s - self._began_s[name] >= SURELY_LOST_S:
            oracle.disarm(f"pressed before the end of: {name}", now_s, 1e-6)

    def end_all(self, now_s: float) -> None:
        """End every fault that is active."""
        for name in list(self.active):
            self.end(name, now_s)
