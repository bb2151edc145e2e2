"""One simulated drive in real time: emulated devices, the unmodified runtime as a process, a record of the truth."""

import asyncio
import math
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.vesc.app_config import RECOMMENDED_BRAKE_A, RECOMMENDED_TIMEOUT_S
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.ending import end
from wallride.runtime.host.address_file import read_address
from wallride.runtime.host.terminal_text import USAGE_ERROR
from wallride.runtime.realtime.periodic import PeriodicTimer, Tick
from wallride.runtime.settings.devices import AnyMotorSettings
from wallride.runtime.wire import topics
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.own import OwnLidarEmulator, OwnMotorEmulator, emulator_of
from wallride.sim.devices.pulse_boards import PulseBoard, start_board
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.turning import TurningEmulator
from wallride.sim.devices.vesc import MotorDemand, VescEmulator
from wallride.sim.live.listener import Listener
from wallride.sim.live.live_conditions import LiveConditions
from wallride.sim.live.record import Record
from wallride.sim.live.runtime_process import RuntimeProcess, WallrideProcess, cpu_s_of
from wallride.sim.live.scenes import Ranges, RecordingScene, WorldScene
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.live.user_code import NO_USER_CODE, UserCode

FAREWELL = "farewell"
BRAKE, MOVES_MPS = "brake", 0.3
"""A motor command that brakes a car of this speed is a hard stop."""
STEP_S = 0.005
SHOW_S = 0.1
SUM_UP_S = 10.0
"""Period after which samples are summed up: the car has been asked by then for settings that were changed."""
START_TIMEOUT_S = 120.0
"""Timeout of the start: the first one compiles the hot path, which takes a busy computer a minute."""
ASKED_WITHIN_S = 20.0
"""Time within which a runtime that has started asks the lidar for scans; a driver of the user's may never do so."""
HEARD_WITHIN_S = 3.0
"""Timeout for the first message; a short drive is over before it arrives."""

TurningLidar = TurningEmulator | OwnLidarEmulator
EmulatedLidar = ScipEmulator | TurningLidar
EmulatedMotor = VescEmulator | PulseBoard | OwnMotorEmulator


class SessionError(Exception):
    """Failure of the runtime to start, or its unexpected end; the text holds its output. exit_code: its own."""

    def __init__(self, said: str, exit_code: int | None = None) -> None:
        super().__init__(said)
        self.exit_code = exit_code


def innermost(group: BaseExceptionGroup[SessionError]) -> SessionError:
    """Return the first error of a group."""
    first = group.exceptions[0]
    return innermost(first) if isinstance(first, BaseExceptionGroup) else first


@dataclass(frozen=True, slots=True)
class RuntimeStart:
    """Start of the runtime. options: further words of its command line. listen: endpoints that it is to have."""

    config: Path
    assignments: Sequence[str] = ()
    options: Sequence[str] = ()
    listen: Sequence[str] = ()


AGAIN_S = 3.0
"""Maximum time after which a car that hit something is put back."""


class SimulatorSession:
    """Builds the emulated car around a scene, runs the runtime with it, and provides the record.

    desired_m: the wanted distance at the start. watched: whether a monitor serves its page meanwhile.
    changes: conditions that the page may change, None for none.
    on_devices: gets the emulators once they run. user_code: the user's laws and drivers, whose faults are recorded; its
    motor takes the place of the VESC.
    """

    def __init__(
        self, scene: WorldScene | RecordingScene, vehicle: Vehicle, wiring: VescSettings, *,
        desired_m: float = math.nan, watched: bool = False, changes: LiveConditions | None = None,
        on_devices: Callable[[ScipEmulator, VescEmulator], None] = lambda _scip, _vesc: None,
        user_code: UserCode = NO_USER_CODE,
    ) -> None:  # fmt: skip
        self._user_code = user_code
        self._pulsed: MaestroSettings | Pca9685Settings | None = None
        self._watched = watched
        self._changes = changes
        self._on_devices = on_devices
        self._others_ready: Callable[[], Awaitable[object]] | None = None
        self._scene = scene
        self._vehicle = vehicle
        self._wiring = wiring
        self.record = Record(desired_m)
        self._over = False

    def fit(self, motor: AnyMotorSettings) -> Self:
        """Have a Maestro or a PCA9685 with an ESC and a servo in place of the VESC, where the settings name one."""
        self._pulsed = motor if isinstance(motor, MaestroSettings | Pca9685Settings) else None
        return self

    def join(self, others_ready: Callable[[], Awaitable[object]]) -> None:
        """Make this car one of several: it waits for the others before anything moves, and a crash ends no drive."""
        self._others_ready = others_ready

    async def run(
        self, start: RuntimeStart, duration_s: float, stop: StopRequest, on_frame: Callable[[Record], None]
    ) -> Record:
        """Drive until the time, the scene or `stop` ends it; `on_frame` is called about ten times a second."""
        record = self.record
        record.listen = start.listen
        async with AsyncExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="wallride-")))
            scip, vesc, addresses = await self._devices(stack, folder)
            told = folder / "address"
            runtime = RuntimeProcess(
                start.config, [*start.assignments, *addresses], [*start.options, "--address-file", str(told)]
            )
            stack.push_async_callback(runtime.end)
            stack.enter_context(stop.killing(runtime.kill))
            record.log = runtime.log
            await runtime.start()
            await self._until_up(scip, runtime, told, on_frame, stop)
            if self._others_ready is not None:
                await self._others_ready()
            async with asyncio.TaskGroup() as tasks:
                listener = self._listener()
                listening = tasks.create_task(listener.run(), name="listener") if listener is not None else None
                if self._watched and listener is not None:
                    await self._open_page(stack, folder / FAREWELL)
                going_on = tasks.create_task(self._timer(scip, self._plant(vesc), on_frame).run(), name="world")
                summing = tasks.create_task(self._sum_up(listener), name="sums")
                await self._until_over(runtime, duration_s, stop)
                self._over = True
                (folder / FAREWELL).write_text(last_words(self._scene, duration_s, asked=stop.asked), encoding="utf-8")
                if listener is not None and not stop.killed:
                    await listener.wait_until_heard(HEARD_WITHIN_S)
                    record.unheard = listener.problem
                    await self._learn_changes(listener)
                record.cpu_s = cpu_s_of(runtime.pid)
                # The world continues while the runtime brings the car to rest.
                record.exit_code = await runtime.stop()
                await end(*filter(None, (going_on, listening, summing)))
        record.sum_up(len(record.fresh))
        return record

    def _timer(self, scip: EmulatedLidar, plant: Plant, on_frame: Callable[[Record], None]) -> PeriodicTimer:
        """Return what moves the world on and shows it."""
        timer = PeriodicTimer(time.monotonic)
        timer.every(STEP_S, self._stepper(scip, plant))
        if (start_at := self._scene.back_to) is not None:
            timer.every(AGAIN_S, lambda _late_s, _missed: plant.put_back(start_at))
        timer.every(SHOW_S, lambda _late_s, _missed: on_frame(self.record))
        return timer

    async def _sum_up(self, listener: Listener | None) -> None:
        while True:
            await asyncio.sleep(SUM_UP_S)
            count = len(self.record.fresh)
            await self._learn_changes(listener)
            self.record.sum_up(count)

    async def _learn_changes(self, listener: Listener | None) -> None:
        if listener is not None:
            self.record.changes = await listener.changes_since(self.record.began_s) or self.record.changes

    async def _motor(self, stack: AsyncExitStack, folder: Path) -> tuple[EmulatedMotor, str]:
        """Start the emulated motor controller; return it and the setting that names its address."""
        if self._user_code.motor:
            own = OwnMotorEmulator(emulator_of("motor", self._user_code.motor), self._on_command)
            stack.push_async_callback(own.close)
            return own, f"motor.own.address={await own.start()}"
        if self._pulsed is not None:
            board, name, place = start_board(self._pulsed, folder, stack, self._on_command)
            return board, f"motor.{name}={place}"
        vesc = VescEmulator(
            folder / "vesc", timeout_s=RECOMMENDED_TIMEOUT_S, timeout_brake_a=RECOMMENDED_BRAKE_A,
            on_command=self._on_command,
        )  # fmt: skip
        vesc.start()
        stack.callback(vesc.close)
        return vesc, f"motor.address=serial://{folder / 'vesc'}"

    async def _devices(self, stack: AsyncExitStack, folder: Path) -> tuple[EmulatedLidar, EmulatedMotor, list[str]]:
        """Start both emulators; returns them and the settings that name their addresses."""
        vesc, motor = await self._motor(stack, folder)
        if isinstance(device := self._scene.turning, OwnLidarEmulator):
            stack.push_async_callback(device.close)
            return device, vesc, [f"lidar.own.address={await device.start()}", motor]
        if device is not None:
            turning = TurningEmulator(device)
            turning.start_serial(folder / "lidar")
            stack.callback(turning.close)
            return turning, vesc, [f"lidar.address=serial://{folder / 'lidar'}", motor]
        scip = ScipEmulator(self._scene.model)
        port = await scip.start_tcp()
        stack.callback(scip.close)
        if isinstance(vesc, VescEmulator):
            self._on_devices(scip, vesc)
        return scip, vesc, [f"lidar.address=tcp://127.0.0.1:{port}", motor]

    async def _until_up(
        self, scip: EmulatedLidar, runtime: RuntimeProcess, told: Path, on_frame: Callable[[Record], None],
        stop: StopRequest,
    ) -> None:  # fmt: skip
        """Wait until the runtime requests scans and has reported its address."""
        record, begin_s, shown_s, known_s = self.record, time.monotonic(), 0.0, 0.0
        while not scip.streaming or record.address is None:
            if stop.asked:
                raise SessionError(f"stopped before the car had started; there is no summary{_told_by(runtime)}")
            record.starting_s = time.monotonic() - begin_s
            known_s = known_s if record.address is not None else record.starting_s
            unasked = record.starting_s - known_s > ASKED_WITHIN_S
            if runtime.exit_code is not None or unasked or record.starting_s > START_TIMEOUT_S:
                silent = f"the lidar sends nothing{_told_by(runtime)}" if unasked and runtime.exit_code is None else ""
                await runtime.stop()
                raise SessionError(silent or _output_of(runtime), runtime.exit_code)
            if record.starting_s - shown_s > SHOW_S:
                shown_s = record.starting_s
                on_frame(record)
            await asyncio.sleep(0.01)
            record.address = read_address(told)

    def _listener(self) -> Listener | None:
        address = self.record.address
        if address is None or not address.endpoint:
            self.record.unheard = address.problem if address is not None else self.record.unheard
            return None
        listener = Listener(address.endpoint, address.car, address.session, self._user_code)
        self.record.telemetry, self.record.own_faults = listener.latest, listener.own_faults
        self.record.poses, self.record.reasons_s = listener.poses, listener.reasons_s
        self.record.recorded = listener.recorded
        if self._changes is not None:
            listener.answer(topics.SIMULATOR, self._changes.answer)
        return listener

    async def _open_page(self, stack: AsyncExitStack, farewell: Path) -> None:
        address = self.record.address
        assert address is not None  # noqa: S101 - the caller has a listener at it
        monitor = WallrideProcess(
            ["monitor", "--connect", address.endpoint, "--car", address.car, "--session", address.session,
             "--farewell", str(farewell)]
        )  # fmt: skip
        self.record.page = monitor.log
        await monitor.start()
        stack.push_async_callback(monitor.stop)  # in order: it deletes the file with the page's address

    async def _until_over(self, runtime: RuntimeProcess, duration_s: float, stop: StopRequest) -> None:
        while self.record.time_s < duration_s and not stop.asked:
            if self._scene.finished and self._others_ready is None:
                return
            if runtime.exit_code is not None:
                said = "\n".join(runtime.log)
                raise SessionError(f"the runtime ended by itself (exit code {runtime.exit_code}); it said:\n{said}")
            await asyncio.sleep(STEP_S)

    def _plant(self, vesc: EmulatedMotor) -> Plant:
        return Plant(self._vehicle, vesc, self._wiring, time.monotonic())

    def _stepper(self, scip: EmulatedLidar, plant: Plant) -> Tick:
        """Return a function that advances the world to the clock, and takes the lidar's scans when they are due."""
        record = self.record
        begin_s = record.began_s = time.monotonic()
        record.began_unix_s = time.time()

        def step(late_s: float, _missed: int) -> None:
            record.held_up.note(late_s)
            now_s = time.monotonic()
            for at_s in plant.catch_up(now_s):
                record.time_s = at_s - begin_s
                if self._scene.step(record.time_s, self._vehicle):
                    plant.crash()
            if isinstance(scip, TurningLidar):
                self._turn(scip, now_s)
            while (due := self._scene.scan(record.time_s, self._vehicle)) is not None:
                if record.steering_rad is not None:
                    record.steering_rad.append(plant.steering_rad)
                self._publish(scip, *due)
                record.note(self._scene.sample(record.time_s, self._vehicle))

        return step

    def _turn(self, lidar: TurningLidar, now_s: float) -> None:
        """Let the head measure what it has passed since the last step; a scan ends where it looks back."""
        before = lidar.turns_past_back
        sent_s = lidar.advance(now_s, lambda rays: self._scene.see(self._vehicle, rays))
        self.record.scans += lidar.turns_past_back - before
        if sent_s is not None and lidar.turns_past_back > before:
            self.record.latency.scan_sent(sent_s)

    def _publish(self, scip: EmulatedLidar, ranges_mm: Ranges, stamp_ms: int) -> None:
        """Send a scan of the Hokuyo; of another lidar it is only what is drawn."""
        self.record.ranges_mm = ranges_mm
        if isinstance(scip, TurningLidar):
            return
        self.record.scans += 1
        sent_s = scip.publish(ranges_mm, stamp_ms)
        if sent_s is not None:
            self.record.latency.scan_sent(sent_s)

    def _on_command(self, at_s: float, demand: MotorDemand) -> None:
        record = self.record
        record.latency.command_received(at_s)
        braked = record.stop_command is not None and record.stop_command.kind == BRAKE
        if demand.kind == BRAKE and not braked and not self._over and abs(self._vehicle.speed_mps) > MOVES_MPS:
            record.hard_stops += 1
        record.stop_command = demand


def last_words(scene: WorldScene | RecordingScene, duration_s: float, *, asked: bool) -> str:
    """Return what the page beside a drive shows after its end. asked: whether the end was requested."""
    by_time = "it was stopped in its terminal" if asked else f"its {duration_s:g} s are over"
    return f"The drive ended: {scene.ending if scene.finished else by_time}. Start another: make sim."


def _told_by(runtime: RuntimeProcess) -> str:
    """Return the last fault of the lidar in the runtime's log, "" where there is none."""
    return next((f"; {line}" for line in reversed(runtime.log) if "lidar faulty" in line), "")


def _output_of(runtime: RuntimeProcess) -> str:
    """Return the reason of a failed start: the runtime's own sentence if it ended with one, else all of its output."""
    if runtime.exit_code == USAGE_ERROR and runtime.log:
        return runtime.log[-1].removeprefix("wallride: ")
    said = "\n".join(runtime.log) or "nothing"
    return f"the runtime did not start (exit code {runtime.exit_code}); it said:\n{said}"
