"""The emulated car alone: a lidar, a motor controller and their world, kept running for a runtime started by hand."""

import asyncio
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from wallride.drivers.api import Clock
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.ending import end
from wallride.runtime.realtime.periodic import PeriodicTimer
from wallride.runtime.settings.devices import AnyMotorSettings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.own import OwnLidarEmulator
from wallride.sim.devices.pulse_boards import PulseBoard, start_board
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.turning import TurningEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.live.latency import HeldUp
from wallride.sim.live.scenes import WorldScene
from wallride.sim.live.session import AGAIN_S, STEP_S, SessionError
from wallride.sim.live.stop_request import StopRequest

HOST: Final = "127.0.0.1"
LIDAR: Final = "lidar"
VESC: Final = "vesc"


@dataclass(frozen=True, slots=True)
class EmulatedPorts:
    """Where the devices appear, under names that stay.

    folder: of the serial ports `lidar` and `vesc`, links to pseudo-terminals; of `maestro` or the socket `i2c` where
    the settings name such a board. A lidar of a full circle has the serial port only. tcp_port: of the lidar, 0 for a
    free one, None for none. serial_lidar: the lidar appears as a serial port, too.
    timeout_s, brake_a: the controller's command timeout, and its brake current afterwards.
    """

    folder: Path
    tcp_port: int | None
    serial_lidar: bool
    timeout_s: float
    brake_a: float


@dataclass(frozen=True, slots=True)
class DeviceAddresses:
    """Addresses as they stand in the settings; lidar: the one to use first. motor_key: the setting of the motor's."""

    lidars: tuple[str, ...]
    motor: str
    motor_key: str = "address"

    @property
    def lidar(self) -> str:
        """Return the address to use: TCP where the lidar has one."""
        return self.lidars[0]


class EmulatedCar:
    """Keeps car and world running for any runtime that connects.

    wiring: the true gains of this car. motor: its settings; those of a board of servo pulses fit one in place of the
    VESC. A car that hit something is put back to its start.
    """

    def __init__(
        self, scene: WorldScene, vehicle: Vehicle, wiring: VescSettings, ports: EmulatedPorts, *,
        motor: AnyMotorSettings | None = None, clock: Clock = time.monotonic,
    ) -> None:  # fmt: skip
        self._clock = clock
        self._scene = scene
        self._vehicle = vehicle
        self._wiring = wiring
        self._ports = ports
        self._pulsed = motor if isinstance(motor, MaestroSettings | Pca9685Settings) else None
        self.lidars: list[ScipEmulator] = []
        self._turning: TurningEmulator | None = None
        self.held_up = HeldUp()
        self.tell_held_up: Callable[[str], object] = lambda _words: None
        self.vesc = VescEmulator(
            ports.folder / VESC, clock=clock, timeout_s=ports.timeout_s, timeout_brake_a=ports.brake_a
        )

    async def keep(self, duration_s: float, stop: StopRequest, tell: Callable[[DeviceAddresses], None]) -> None:
        """Run until the time or `stop` ends it; `tell` gets the addresses. SessionError where a port is taken."""
        start, begin_s = self._vehicle.pose, self._clock()
        async with AsyncExitStack() as stack:
            lidars = await self._open_lidar(stack)
            motor, key, address = self._open_motor(stack)
            plant = Plant(self._vehicle, motor, self._wiring, begin_s)
            timer = PeriodicTimer(self._clock)
            timer.every(STEP_S, lambda late_s, _missed: self._step(plant, begin_s, late_s))
            timer.every(AGAIN_S, lambda _late_s, _missed: plant.put_back(start))
            going_on = asyncio.create_task(timer.run(), name="world")
            tell(DeviceAddresses(lidars, address, key))
            while self._clock() - begin_s < duration_s and not stop.asked:
                if going_on.done():
                    going_on.result()
                await asyncio.sleep(STEP_S)
            await end(going_on)

    async def _open_lidar(self, stack: AsyncExitStack) -> tuple[str, ...]:
        ports, found = self._ports, []
        ports.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if self._scene.turning is not None and not isinstance(self._scene.turning, OwnLidarEmulator):
            self._turning = TurningEmulator(self._scene.turning, clock=self._clock)
            self._turning.start_serial(ports.folder / LIDAR)
            stack.callback(self._turning.close)
            return (f"serial://{ports.folder / LIDAR}",)
        if ports.tcp_port is not None:
            lidar = self._lidar(stack)
            try:
                found.append(f"tcp://{HOST}:{await lidar.start_tcp(HOST, ports.tcp_port)}")
            except OSError as error:
                raise SessionError(
                    f"{HOST}:{ports.tcp_port}: {error.strerror or error}; another emulated car? end it, or --port 0"
                ) from None
        if ports.serial_lidar:
            self._lidar(stack).start_serial(ports.folder / LIDAR)
            found.append(f"serial://{ports.folder / LIDAR}")
        return tuple(found)

    def _open_motor(self, stack: AsyncExitStack) -> tuple[VescEmulator | PulseBoard, str, str]:
        """Start the motor controller; return it, and the setting that names its place, with its value."""
        if self._pulsed is not None:
            return start_board(self._pulsed, self._ports.folder, stack)
        self.vesc.start()
        stack.callback(self.vesc.close)
        return self.vesc, "address", f"serial://{self._ports.folder / VESC}"

    def _lidar(self, stack: AsyncExitStack) -> ScipEmulator:
        lidar = ScipEmulator(self._scene.model, clock=self._clock)
        stack.callback(lidar.close)
        self.lidars.append(lidar)
        return lidar

    def _step(self, plant: Plant, begin_s: float, late_s: float) -> None:
        if self.held_up.note(late_s):
            self.tell_held_up(self.held_up.words)
        now_s = self._clock()
        for at_s in plant.catch_up(now_s):
            if self._scene.step(at_s - begin_s, self._vehicle):
                plant.crash()
        if self._turning is not None:
            self._turning.advance(now_s, lambda rays: self._scene.see(self._vehicle, rays))
            return
        while (due := self._scene.scan(now_s - begin_s, self._vehicle)) is not None:
            for lidar in self.lidars:
                lidar.publish(*due)
