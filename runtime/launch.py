"""One drive from start to end: the real devices, the session, the signals. Everything that a process has only once."""

import asyncio
import gc
import logging
import signal
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drivers.hokuyo.driver import Hokuyo
from drivers.vesc.driver import Vesc
from runtime import kernel
from runtime.app import Car, history_file
from runtime.bus import Bus
from runtime.cadence import Cadence
from runtime.control import methods
from runtime.few_ports import FewPorts
from runtime.journal import journal
from runtime.settings import Settings
from runtime.tasks import parameters
from runtime.wakefulness import awake
from runtime.warmth import Warmth

log = logging.getLogger("wallride.launch")


def main(settings: Settings, file: Path | None, session: Mapping[str, Any], warnings: Sequence[str]) -> None:
    """Drive until SIGINT or SIGTERM; returns when the car stands.

    file: where live parameters are saved. session: the configuration of the zenoh session.
    warnings: what the owner should hear first.
    """
    with journal(settings.log.level, settings.log.format):
        for warning in warnings:
            log.warning("%s", warning)
        compiled = kernel.use()
        log.info("%s", compiled.words)
        with awake(wanted=settings.process.stay_awake) as words:
            log.info("%s", words)
            with asyncio.Runner(loop_factory=punctual_loop) as runner:
                runner.run(_drive(settings, file, session, Warmth(compiled.prefetch)))


def punctual_loop() -> asyncio.AbstractEventLoop:
    """Return an event loop whose timers are right to 0.1 ms."""
    return asyncio.SelectorEventLoop(FewPorts())


async def _drive(settings: Settings, file: Path | None, session: Mapping[str, Any], warmth: Warmth) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    clock = time.monotonic
    bus = Bus(session)
    cadence = Cadence()

    def replied(took_s: float) -> None:
        cadence.replied(took_s)
        if cadence.expects(clock()):
            warmth.warm()  # the last that is done before the scan

    motor = Vesc(settings.motor, clock=clock, clear_s=cadence.clear_s, replied=replied)
    lidar = Hokuyo(settings.lidar, clock=clock, clear_s=cadence.clear_s)
    car = Car(
        settings, lidar, motor, bus, clock, file, reading_s=lambda: lidar.reading_s, cadence=cadence, warmth=warmth
    )
    motor.inertia.on_measurement = car.telemetry.on_imu
    if (history := history_file(settings)) is not None:
        parameters.read_history(car.history, history)
    methods.warm_up(settings.wall_follow, settings.safety, settings.car)
    gc.collect()
    gc.freeze()  # a full collection would block the loop for milliseconds; what exists now stays anyway
    opening = asyncio.create_task(_open(car, bus), name="bus") if settings.telemetry.enabled else None
    car.stages.watch_collections()
    lidar.tap, motor.tap = car.recorder.tap("lidar"), car.recorder.tap("motor")
    car.recorder.start()
    try:
        await car.drive(stop)
    finally:
        warmth.stop()
        car.stages.ignore_collections()
        for line in car.stages.table():
            log.info("%s", line)
        car.manager.stopping()
        if opening is not None:
            await opening
        await bus.close()
        await asyncio.to_thread(car.recorder.close)


async def _open(car: Car, bus: Bus) -> None:
    car.connect()
    try:
        await bus.open()
        log.info("telemetry on %s", bus.endpoint)
    except OSError as error:
        log.error("driving without telemetry: %s", error)
