"""The composition root: the one place where devices, queues and tasks meet. Read `drive` and you know the dataflow."""

import asyncio
import gc
import logging
import signal
import time
from collections.abc import Mapping
from typing import Any

from drivers.api import Clock, Drive, Lidar, Motor, Scan
from drivers.hokuyo.driver import Hokuyo
from drivers.vesc.driver import Vesc
from runtime import wire, zenoh_config
from runtime.bus import Bus
from runtime.car_settings import CarSettings
from runtime.command import Output, Source
from runtime.control import methods
from runtime.control.freeing import Lookout
from runtime.control.guidance import Guidance
from runtime.control.limiter import Limiter, Limits
from runtime.control.odometry import Odometry
from runtime.control.score import Score
from runtime.journal import journal
from runtime.permit import Permit
from runtime.queues import Inbox
from runtime.service_manager import ServiceManager
from runtime.settings import Settings
from runtime.tasks import lidar as lidar_task
from runtime.tasks import mux as mux_task
from runtime.tasks import safety, telemetry, wall_follow
from runtime.tasks.health import Caretaker
from runtime.voices import Voices

log = logging.getLogger("wallride.app")

REQUIRED = frozenset({Source.SAFETY, Source.PERMIT})
"""Voices whose silence is a stop for everyone less urgent."""
REST_TIMEOUT_S = 1.0
REST_PERIOD_S = 0.02
REST_BELOW_MPS = 0.05


class Car:
    """Everything that one drive shares. Built once, from settings and two devices; `drive` runs it."""

    def __init__(self, settings: Settings, lidar: Lidar, motor: Motor, bus: telemetry.Publisher, clock: Clock) -> None:
        self.settings = settings
        self.lidar = lidar
        self.motor = motor
        self.bus = bus
        self.clock = clock
        self.manager = ServiceManager()
        self.voices = Voices(settings.effective_order(), clock)
        self.permit = Permit(self.voices, settings.operator.permit)
        self.mux = mux_task.Mux(self.voices, motor, Limiter(_limits(settings.car)), REQUIRED, clock)
        self.follower, self.guard = methods.laws(settings.wall_follow, settings.safety, settings.car, clock)
        self.outbox: telemetry.Outbox = telemetry.Outbox(clock)
        self.odometry = Odometry(settings.car.wheelbase_m)
        self.score = Score()
        self.scans = 0

    async def drive(self, stop: asyncio.Event) -> None:
        """Drive until `stop` is set or a task fails; the car is brought to rest on every way out."""
        async with asyncio.TaskGroup() as devices:
            keeper = devices.create_task(self.motor.run(), name="motor")
            try:
                async with asyncio.TaskGroup() as tasks:
                    driving = self._start(tasks)
                    tasks.create_task(_until(stop, driving), name="stop")
            finally:
                await bring_to_rest(self.motor, self.clock)
                keeper.cancel()

    def _start(self, tasks: asyncio.TaskGroup) -> list[asyncio.Task[Any]]:
        settings, motor, voices, clock = self.settings, self.motor, self.voices, self.clock
        for_safety: Inbox[Scan] = Inbox(clock)
        for_follower: Inbox[Scan] = Inbox(clock)
        jobs = {
            "lidar": lidar_task.pump(self.lidar, [for_safety, for_follower]),
            "safety": safety.watch(
                for_safety, motor, self.guard, voices,
                expires_after_s=settings.safety.expires_after_s,
            ),
            "wall_follow": wall_follow.follow(
                for_follower, motor, self.follower, voices,
                expires_after_s=settings.wall_follow.expires_after_s, publish=self._on_guidance,
            ),
            "mux": self.mux.run(self._on_output),
            "tick": mux_task.tick(voices, settings.mux.tick_hz, clock),
            "health": self._caretaker().run(),
            "telemetry": telemetry.publish(self.outbox, self.bus, settings.car.name),
            "status": telemetry.report_status(
                self.bus, settings.car.name, self.status, settings.telemetry.status_hz, clock
            ),
        }  # fmt: skip
        return [tasks.create_task(job, name=name) for name, job in jobs.items()]

    def _caretaker(self) -> Caretaker:
        return Caretaker(
            lidar=self.lidar,
            motor=self.motor,
            output=lambda: self.mux.output,
            voices=self.voices,
            permit=self.permit,
            manager=self.manager,
            clock=self.clock,
            retry_faults=self.settings.operator.permit == "always",
        )

    def _on_guidance(self, scan: Scan, guidance: Guidance) -> None:
        self.scans += 1
        self.score.add(guidance.error_m)
        message = {
            "topic": wire.DISTANCE_ERROR,
            "stamp_s": scan.stamp_s,
            "distance_m": guidance.distance_m,
            "error_m": guidance.error_m,
            "angle_rad": guidance.angle_rad,
        }
        self.outbox.put(wire.DISTANCE_ERROR, message, priority=2, expires_at_s=self.clock() + 1)

    def _on_output(self, output: Output) -> None:
        self.odometry.update(self.motor.state)
        message = {"topic": wire.OUTPUT, "stamp_s": output.stamp_s, **_output_fields(output)}
        self.outbox.put(wire.OUTPUT, message, priority=1, expires_at_s=self.clock() + 1)

    def status(self) -> Mapping[str, Any]:
        """Return the answer to "why is it (not) moving" as plain values."""
        state, pose, output = self.motor.state, self.odometry.pose, self.mux.output
        return {
            "car": self.settings.car.name,
            "stamp_s": self.clock(),
            "output": _output_fields(output) if output is not None else None,
            "voices_age_s": {str(source): age_s for source, age_s in self.voices.ages_s().items()},
            "seconds_by_winner": self.mux.seconds_by_winner,
            "distance_error": {"mean_abs_m": self.score.mean_abs_m, "rms_m": self.score.rms_m},
            "scans": self.scans,
            "lidar": _health_fields(self.lidar),
            "window": self.guard.words if isinstance(self.guard, Lookout) else (),
            "motor": _health_fields(self.motor),
            "speed_mps": state.speed_mps if state is not None else None,
            "voltage_v": state.voltage_v if state is not None else None,
            "fault": state.fault if state is not None else "",
            "odom": {"x_m": pose.x_m, "y_m": pose.y_m, "yaw_rad": pose.yaw_rad},
        }


async def bring_to_rest(motor: Motor, clock: Clock) -> None:
    """Brake until the wheels stand or REST_TIMEOUT_S is over; the first brake goes out at once."""
    give_up_s = clock() + REST_TIMEOUT_S
    steering_rad = motor.state.steering_rad if motor.state is not None else 0.0
    while motor.send(Drive(0.0, steering_rad)) and clock() < give_up_s:
        state = motor.state
        if state is not None and abs(state.speed_mps) < REST_BELOW_MPS:
            return
        await asyncio.sleep(REST_PERIOD_S)


def main(settings: Settings) -> None:
    """Drive until SIGINT or SIGTERM; returns when the car stands."""
    with journal(settings.log.level, settings.log.format):
        asyncio.run(_main(settings))


async def _main(settings: Settings) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    clock = time.monotonic
    bus = Bus(zenoh_config.car_config([settings.telemetry.listen], None, (), settings.car.name))
    car = Car(settings, Hokuyo(settings.lidar, clock=clock), Vesc(settings.motor, clock=clock), bus, clock)
    methods.warm_up(settings.wall_follow, settings.safety, settings.car)
    gc.collect()
    gc.freeze()  # a full collection would block the loop for milliseconds; what exists now stays anyway
    opening = asyncio.create_task(_open_bus(bus), name="bus") if settings.telemetry.enabled else None
    try:
        await car.drive(stop)
    finally:
        car.manager.stopping()
        if opening is not None:
            await opening
        await bus.close()


async def _open_bus(bus: Bus) -> None:
    try:
        await bus.open()
    except OSError as error:
        log.error("driving without telemetry: %s", error)


async def _until(stop: asyncio.Event, tasks: list[asyncio.Task[Any]]) -> None:
    await stop.wait()
    log.info("asked to stop")
    for task in tasks:
        task.cancel()


def _limits(car: CarSettings) -> Limits:
    return Limits(
        max_speed_mps=car.max_speed_mps,
        max_reverse_mps=car.max_reverse_mps,
        max_steering_rad=car.max_steering_rad,
        steering_rate_radps=car.steering_rate_radps,
        max_acceleration_mps2=car.max_acceleration_mps2,
    )


def _output_fields(output: Output) -> dict[str, Any]:
    decision = output.decision
    return {
        "speed_mps": output.drive.speed_mps,
        "steering_rad": output.drive.steering_rad,
        "driver": decision.driver,
        "winner": decision.winner or "nobody",
        "reason": decision.reason,
        "measure": decision.measure,
        "delivered": output.delivered,
    }


def _health_fields(device: Lidar | Motor) -> dict[str, Any]:
    health = device.health
    return {
        "link": str(health.link),
        "message": health.message,
        "identity": health.identity,
        "counts": dict(health.counts),
    }
