"""A car that only talks: real telemetry on a real session, fed with the same scan for ever."""

import asyncio
import time
from contextlib import asynccontextmanager

from tests.runtime.observed import GUIDANCE, make_observed, output_of, scan_at, speak
from tests.typed import telling
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.tasks.telemetry import Telemetry
from wallride.runtime.telemetry.sinks import ZenohSink
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint


@asynccontextmanager
async def speaking_car(name="car1", rates=None, **verdict):
    """Yield the car's session; `verdict` goes to `speak`."""
    bus = Bus(zenoh_config.car_config([free_endpoint()], None, (), name))
    await bus.open()
    bus.announce(topics.key(name, topics.ALIVE))
    observed = make_observed(time.monotonic, link=lambda: {"endpoint": bus.endpoint})
    sink = ZenohSink(bus, name, rates or RatesHz())
    telemetry = Telemetry(
        observed, CarSettings(name=name), [sink], wall_clock=WallClock(lambda: 0.0, lambda: 10**18), side=lambda: "left"
    )

    async def turn():
        while True:
            scan = scan_at(time.monotonic())
            telemetry.on_scan(scan)
            speak(observed, **verdict)
            telemetry.on_guidance(scan, GUIDANCE)
            telemetry.on_output(output_of(observed))
            await asyncio.sleep(0.02)

    async with asyncio.TaskGroup() as tasks:
        running = [tasks.create_task(turn()), tasks.create_task(telemetry.run())]
        try:
            yield bus
        finally:
            for task in running:
                task.cancel()
            await bus.close()


def options(car, *arguments):
    """Return the options of a command line against a car, and the list that will hold what it says."""
    return telling(*arguments, "--connect", car.endpoint)
