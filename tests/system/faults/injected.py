"""Faults that are injected into the unmodified process between its emulated devices, and what must follow."""

import asyncio
import itertools
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from tests.system.bench import CORRIDOR_MM, Bench
from tests.system.faults.computer_faults import (
    drop_lidar,
    empty_disk_and_clear,
    fill_disk_and_block,
    give_descriptors,
    give_memory,
    go_on,
    hog_and_block,
    paused_for,
    shift_wall_clock,
    stopped_for,
    take_descriptors,
    take_memory_and_drop_lidar,
    unhog_and_clear,
)
from wallride.drivers.vesc.codec import Packet

SETTLED_S = 0.15
"""From the first brake on: commands that were on their way are in by now."""
STANDS_FOR_S = 1.0
VESC_TIMEOUT_S = 0.15
GOES_ON_MPS = 0.9
"""What a car that drives at 1 m/s asks for at least, where a fault is to change nothing."""


@dataclass(frozen=True)
class Injected:
    """A fault that begins while the car drives.

    begin, end: begin and end it. settings: of the car. measure: returns the time of the reaction after a moment.
    from_scan: the bound counts from the last good scan on the wire, not from the fault. max_mps: what the wire may ask
    for between the reaction and the end of the fault; 0 is a standstill, infinity for a fault that is over at once.
    stops: whether the car brakes; otherwise the figure is the longest time without a motor command. program: that runs.
    """

    begin: Callable[[Bench], Awaitable[None] | None]
    end: Callable[[Bench], Awaitable[None] | None] = lambda _: None
    settings: tuple[str, ...] = ()
    measure: Callable[[Bench, float], float] = Bench.first_brake_s
    from_scan: bool = False
    max_mps: float = 0.0
    stops: bool = True
    program: str = "wallride"


def asked_mps(car: Bench, since_s: float) -> list[float]:
    """Return the speeds that were asked for on the motor's wire since a moment."""
    return [
        int.from_bytes(payload[1:5], "big", signed=True) / 4614.0
        for _, payload in car.motor_commands(since_s)
        if payload[0] == Packet.SET_RPM
    ]


def slowed_s(car: Bench, since_s: float) -> float:
    """Return when no more than 1 m/s was asked for, infinity while there was none such."""
    slow = (
        at_s
        for at_s, payload in car.motor_commands(since_s)
        if payload[0] == Packet.SET_RPM and int.from_bytes(payload[1:5], "big", signed=True) <= 4614 * 1.01
    )
    return next(slow, math.inf)


def released_s(car: Bench, _since_s: float) -> float:
    """Return when the motor controller itself let go of the speed; infinity while it holds it."""
    now_s = time.monotonic()
    return now_s if car.vesc.demand(now_s).kind != "speed" else math.inf


def show(**faults: object) -> Callable[[Bench], None]:
    """Return an injector that sets attributes of the bench: `vesc__silent=True` is `bench.vesc.silent`."""

    def inject(car: Bench) -> None:
        for name, value in faults.items():
            owner, _, attribute = name.rpartition("__")
            setattr(getattr(car, owner) if owner else car, attribute, value)

    return inject


def both(*injectors: Callable[[Bench], None]) -> Callable[[Bench], None]:
    """Return an injector that runs others in order."""

    def inject(car: Bench) -> None:
        for each in injectors:
            each(car)

    return inject


def reboot_vesc(car: Bench) -> None:
    """Take the motor controller's power for a moment: its port goes, the servo centres, it coasts."""
    car.vesc.unplug()
    car.vesc.reboot()


def restart_vesc(car: Bench) -> None:
    """Bring it back."""
    car.vesc.replug()


INJECTED: dict[str, Injected] = {
    "lidar garbage": Injected(
        show(scip__garbage_every=1, scip__bad_checksum_every=1),
        show(scip__garbage_every=None, scip__bad_checksum_every=None),
        from_scan=True,
    ),
    "lidar bad checksums": Injected(
        show(scip__bad_checksum_every=1), show(scip__bad_checksum_every=None), from_scan=True
    ),
    "lidar frozen": Injected(show(scip__frozen=True), show(scip__frozen=False)),
    "lidar clock jumps ahead": Injected(show(stamp_jump_ms=3_600_000), from_scan=True, max_mps=math.inf),
    "lidar clock jumps back": Injected(show(stamp_jump_ms=-1_000), from_scan=True, max_mps=math.inf),
    "lidar covered": Injected(show(scan_mm=CORRIDOR_MM * 0 + 65533), show(scan_mm=CORRIDOR_MM)),
    "lidar hand before it": Injected(show(scan_mm=CORRIDOR_MM * 0 + 60), show(scan_mm=CORRIDOR_MM)),
    "lidar unplugged": Injected(drop_lidar, lambda car: car.scip.listen_again(), from_scan=True),
    "motor mute": Injected(show(vesc__silent=True), show(vesc__silent=False)),
    "motor bad checksums": Injected(show(vesc__bad_crc=True), show(vesc__bad_crc=False)),
    "motor garbage": Injected(show(vesc__garbage=True), show(vesc__garbage=False)),
    "motor deaf": Injected(show(vesc__deaf=True), show(vesc__deaf=False), measure=released_s),
    "motor reboots": Injected(reboot_vesc, restart_vesc, measure=released_s),
    "motor kill switch": Injected(show(vesc__kill_switch=True), show(vesc__kill_switch=False)),
    "motor fault": Injected(lambda car: car.vesc.inject_fault(3)),
    "motor impossible speed": Injected(show(vesc__shown_erpm=10**6), show(vesc__shown_erpm=None)),
    "power empty battery": Injected(show(voltage_v=9.0), show(voltage_v=11.8)),
    "power absent battery": Injected(show(voltage_v=0.4), show(voltage_v=11.8)),
    "power low battery": Injected(
        show(voltage_v=10.0),
        show(voltage_v=11.8),
        settings=("wall_follow.speed_mps=2",),
        measure=slowed_s,
        max_mps=1.01,
    ),
    "process both devices silent": Injected(
        show(vesc__silent=True, scan_mm=None), show(vesc__silent=False, scan_mm=CORRIDOR_MM)
    ),
    "process both devices unplugged": Injected(
        both(drop_lidar, lambda car: car.vesc.unplug()),
        both(restart_vesc, lambda car: car.scip.listen_again()),
        measure=released_s,
    ),
    "process stopped 200 ms": Injected(stopped_for(0.2), go_on, measure=released_s),
    "process stopped 1 s": Injected(stopped_for(1.0), go_on, measure=released_s),
    "power busy processors": Injected(hog_and_block, unhog_and_clear),
    "process stopped 50 ms": Injected(paused_for(0.05), stops=False),
    "process clock jumps a day": Injected(
        shift_wall_clock,
        settings=("recording.start=always",),
        stops=False,
        program="tests.system.faults.shifted_clock",
    ),
    "process no memory left": Injected(take_memory_and_drop_lidar, give_memory, from_scan=True),
    "process no descriptors left": Injected(take_descriptors, give_descriptors, from_scan=True),
    "process disk full": Injected(fill_disk_and_block, empty_disk_and_clear, settings=("recording.start=always",)),
}


async def suffer(car: Bench, fault: Injected) -> float:
    """Drive, inject the fault, see the reaction, end the fault, drive again; return the time of the reaction [s].

    The bench permits always, so that every car drives again once its fault is over; what a permit that is required
    makes of it is the matter of the virtual stories.
    """
    await car.until_driving()
    if not fault.stops:
        return await drive_on(car, fault)
    began_s = time.monotonic()
    before_s = car.last_good_scan_s
    suffering = fault.begin(car)
    task = asyncio.ensure_future(suffering) if suffering is not None else None
    reacted_s = math.inf

    def has_reacted() -> bool:
        nonlocal reacted_s
        reacted_s = min(reacted_s, fault.measure(car, began_s))
        return math.isfinite(reacted_s)

    await car.until(has_reacted, "the reaction", 5.0)
    if task is not None:
        await task
    await asyncio.sleep(SETTLED_S)
    settled_s = time.monotonic()
    await asyncio.sleep(STANDS_FOR_S)
    assert max(asked_mps(car, settled_s), default=0.0) <= fault.max_mps, "motion in a fault"
    ending = fault.end(car)
    if ending is not None:
        await ending
    await car.until_driving()
    return reacted_s - (before_s if fault.from_scan else began_s)


async def drive_on(car: Bench, fault: Injected) -> float:
    """Inject a fault that stops no car; return the longest time without a motor command meanwhile [s]."""
    began_s = time.monotonic()
    suffering = fault.begin(car)
    if suffering is not None:
        await suffering
    await asyncio.sleep(STANDS_FOR_S + SETTLED_S)
    assert min(asked_mps(car, began_s)) >= GOES_ON_MPS, "it was slowed"
    assert car.first_brake_s(began_s) == math.inf, "it braked"
    assert car.vesc.demand(time.monotonic()).kind == "speed", "the controller let go"
    times_s = [at_s for at_s, _ in car.motor_commands(began_s)]
    return max(after - before for before, after in itertools.pairwise([began_s, *times_s]))
