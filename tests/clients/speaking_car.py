"""Cars on real sessions: a silent one, one with heartbeats, and one with the telemetry of one scan for ever."""

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
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.teleop import Beat, CarCondition, is_stop, read_command


class CarSession:
    """A car's session at a free endpoint, open while it is entered. Subclasses answer in `serve`."""

    def __init__(self, name="car1", *, is_announced=True):
        self.bus = Bus(zenoh_config.car_config([free_endpoint()], None, (), name))
        self.name, self.is_announced = name, is_announced
        self.endpoint = self.bus.endpoint

    def serve(self):
        """Answer on the session."""

    async def __aenter__(self):
        self.serve()
        if self.is_announced:
            self.bus.announce(topics.key(self.name, topics.ALIVE))
        await self.bus.open()
        return self

    async def __aexit__(self, *_):
        await self.bus.close()


@asynccontextmanager
async def client_bus(endpoint):
    """Yield a client's session at an endpoint."""
    bus = Bus(zenoh_config.client_config(endpoint, None))
    await bus.open()
    try:
        yield bus
    finally:
        await bus.close()


@asynccontextmanager
async def beating_car(name="car1", *, obeys=True, latched=False, session=7):
    """A car that answers an e-stop with its heartbeats; yields its endpoint and the commands that came."""
    came, state = [], {"latched": latched}

    def on_command(_key, payload, _s):
        came.append(read_command(payload))
        state["latched"] |= obeys and is_stop(came[-1].flags)

    async def beat(bus):
        number = 0
        while True:
            number += 1
            condition = CarCondition.ESTOP_LATCHED if state["latched"] else CarCondition(0)
            bus.put(topics.key(name, topics.BEAT), Beat(session, number, condition).pack(), encoding=BYTES)
            await asyncio.sleep(0.02)

    async with CarSession(name) as car:
        car.bus.subscribe(topics.key(name, topics.COMMAND), on_command)
        beating = asyncio.create_task(beat(car.bus))
        try:
            yield car.endpoint, came
        finally:
            beating.cancel()


@asynccontextmanager
async def speaking_car(name="car1", rates=None, **verdict):
    """Yield the session of a car that tells; `verdict` goes to `speak`."""
    bus = (car := CarSession(name)).bus
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

    async with car, asyncio.TaskGroup() as tasks:
        running = [tasks.create_task(turn()), tasks.create_task(telemetry.run())]
        try:
            yield bus
        finally:
            for task in running:
                task.cancel()


def options(car, *arguments):
    """Return the options of a command line against a car, and the list that will hold what it says."""
    return telling(*arguments, "--connect", car.endpoint)
