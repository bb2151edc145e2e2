"""One drive from start to end: the real devices, the session, the signals; all that a process has only once."""

import asyncio
import atexit
import gc
import logging
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from wallride.drivers.api import Clock
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.pwm.driver import PwmMotor
from wallride.drivers.turning.driver import TurningLidar
from wallride.drivers.vesc.driver import Vesc
from wallride.runtime import kernel
from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.own_laws.law_class import loaded_files
from wallride.runtime.ending import end
from wallride.runtime.host.address_file import Address, write_address
from wallride.runtime.host.computer import read_computer
from wallride.runtime.host.ending import end_in_time
from wallride.runtime.host.logging_setup import journal
from wallride.runtime.host.scheduling import ask_for_precedence, keep_for_this_thread
from wallride.runtime.host.stop_signals import STOP_SIGNALS, STOP_SIGNALS_HELD
from wallride.runtime.host.user_module import is_of_the_process, shown, told
from wallride.runtime.lidars import TurnMotion, lidar_for, motor_for
from wallride.runtime.line_files import read_course
from wallride.runtime.map_files import MapError
from wallride.runtime.own_drivers.driver_class import loaded_driver_files
from wallride.runtime.own_drivers.lidar import OwnLidar
from wallride.runtime.own_drivers.motor import OwnMotor
from wallride.runtime.realtime.cpu_latency import awake
from wallride.runtime.realtime.scan_phase import ScanPhase
from wallride.runtime.realtime.selector import CheckedSelector
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.rehearsal import Rehearsal
from wallride.runtime.restarting import ProcessRestart
from wallride.runtime.scan_topic import TopicLidar
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks import parameters
from wallride.runtime.tasks.computer import ComputerWatch
from wallride.runtime.teleop.local_operator import LocalOperator
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import PortTakenError
from wallride.runtime.wire.port_holder import holder_of, taken_sentence
from wallride.runtime.wire.teleop import session_text
from wallride.runtime.wire.uplink import Uplink, UplinkedBus

log = logging.getLogger("wallride.launch")

Devices = tuple[Vesc | PwmMotor | OwnMotor, Hokuyo | TurningLidar | TopicLidar | OwnLidar]

SWITCH_S: Final = 5e-4
"""Time after which a thread that computes in Python leaves the interpreter to another, in a car with laws of the user:
the loop waits that long after each system call. Python's own 5 ms let one busy thread of a law hold up the car for half
a second; without such a thread they keep the recorder from interrupting an answer."""
CAST_BUFFER: Final = 2048
"""Numbers that numpy casts at a time. Where it finds no memory for them (64 KiB by default), it ends the process."""


class BrakingMotor(Protocol):
    """A motor that can brake without the event loop."""

    def brake_now(self) -> None:
        """Write one brake; never raises."""


HOLD_WITHIN_S = 3.0
"""Maximum time that the car stands still for the session to open, so that one whose port is taken ends before it
moved."""
LEFT_AFTER_S = 0.3
"""Maximum time for which a car that stands waits for a session that still opens, after a signal to end."""


class LaunchError(Exception):
    """The car cannot be started with its settings; the text names the remedy."""


@dataclass(frozen=True, slots=True)
class Files:
    """The files of a process. saved: live parameters; base: the settings file below that one, if any.

    address: destination of telemetry's address. overrides: of the command line, KEY=VALUE. restart: of the process.
    """

    saved: Path | None = None
    base: Path | None = None
    address: Path | None = None
    overrides: Sequence[str] = ()
    restart: ProcessRestart | None = None

    def words(self, settings: Settings) -> tuple[int, str]:
        """Return the level of the log and the line that says whose settings count."""
        over = "".join(f", --set {one}" for one in self.overrides)
        if self.base is None and self.saved is None:
            wheelbase = f"a wheelbase of {settings.car.wheelbase_m:g} m"
            return logging.WARNING, f"no settings file: the defaults count{over}, {wheelbase} among them"
        saved = f", above it {self.saved}" if self.base is not None else ""
        return logging.INFO, f"settings of {self.base or self.saved}{saved}{over}"


@dataclass(frozen=True, slots=True)
class Sessions:
    """Configurations of the zenoh sessions: the car's own, and one for each router."""

    own: Mapping[str, Any]
    routers: Sequence[Mapping[str, Any]] = ()


def main(
    settings: Settings, files: Files, sessions: Sessions, warnings: Sequence[str], joystick: LocalOperator | None = None
) -> None:
    """Drive until SIGINT or SIGTERM; return once the car stands. LaunchError when its port is taken.

    warnings: reported to the owner first. joystick: a gamepad on the car itself.
    """
    scheduling = keep_for_this_thread()
    np.setbufsize(CAST_BUFFER)
    if loaded_files() or loaded_driver_files():
        sys.setswitchinterval(SWITCH_S)
    with journal(settings.log.level, settings.log.format):
        log.log(*files.words(settings))
        log.info("%s", scheduling)
        for warning in warnings:
            log.warning("%s", warning)
        log.info("%s", kernel.state().words)
        with awake(wanted=settings.process.stay_awake) as words:
            log.info("%s", words)
            motors: list[BrakingMotor] = []
            with (
                ending_without_memory(),
                ending_with_its_line(),
                braking_last(motors),
                asyncio.Runner(loop_factory=PunctualLoop) as runner,
                braking_last(motors),
            ):
                runner.run(_drive(settings, files, sessions, motors.append, joystick))


@contextmanager
def braking_last(motors: Sequence[BrakingMotor]) -> Iterator[None]:
    """Brake when this block is left, in any way: the loop may have ended without one `finally` of its tasks.

    After an error the process ends within MAX_ENDING_S, so that the service manager restarts it, even when closing
    hangs.
    """

    def brake() -> None:
        for motor in motors:
            motor.brake_now()

    atexit.register(brake)  # sys.exit in a thread that never came back here, or a second error in a `finally`
    try:
        yield
    except LaunchError:
        brake()
        raise
    except BaseException:
        brake()
        end_in_time(1)
        raise
    else:
        brake()
    finally:
        atexit.unregister(brake)


@contextmanager
def ending_without_memory() -> Iterator[None]:
    """Have a drive that what decides or drives could not go on with for want of memory end with a sentence."""
    try:
        yield
    except (BaseExceptionGroup, MemoryError) as error:
        first: BaseException = error
        while isinstance(first, BaseExceptionGroup):
            if first.split(MemoryError)[1] is not None:
                raise
            first = first.exceptions[0]
        place = traceback.extract_tb(first.__traceback__)[-1]
        log.error(
            "out of memory (%s:%d): the car was braked and wallride ends; see what else uses memory, "
            "or raise the limit (MemoryMax= of the service)", Path(place.filename).name, place.lineno,
        )  # fmt: skip
        raise SystemExit(1) from None


@contextmanager
def ending_with_its_line() -> Iterator[None]:
    """Have a drive that a driver or law of the user ended in a callback of the loop end with a sentence, as an error.

    The loop passes on a SystemExit and a KeyboardInterrupt: `sys.exit()` would look like a wanted end.
    """
    try:
        yield
    except (SystemExit, KeyboardInterrupt) as error:
        folders = {file.parent for file in (*loaded_files(), *loaded_driver_files())}
        frames = traceback.extract_tb(error.__traceback__)
        lines = [(path, frame.lineno) for frame in frames if (path := Path(frame.filename)).parent in folders]
        if not lines or is_of_the_process(error):
            raise
        path, line = lines[-1]
        log.error(
            "%s:%s raised %s in a callback of the event loop: the car was braked and wallride ends",
            shown(path), line, told(error),
        )  # fmt: skip
        raise SystemExit(1) from None


class PunctualLoop(asyncio.SelectorEventLoop):
    """An event loop whose timers are accurate to 0.1 ms, and whose other threads do not hold it up."""

    def __init__(self) -> None:
        super().__init__(CheckedSelector())
        self._threads = ThreadPoolExecutor(thread_name_prefix="asyncio", initializer=ask_for_precedence)
        self.set_default_executor(self._threads)

    def _check_signal(self, sig: int) -> None:
        """Leave it to C: the base class lists all signals for it, of every signal that is held, once a second."""

    def add_signal_handler(self, sig: int, callback: Callable[..., object], *args: object) -> None:
        """Add a handler; RuntimeError for a signal that stops the car, whose handler is the car's own."""
        if sig in STOP_SIGNALS and callback is not _set:
            raise RuntimeError(f"signal {sig} stops the car; its handler cannot be replaced")
        super().add_signal_handler(sig, callback, *args)

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ARG002, ASYNC109
        """Take no more work. The base class starts one more thread for it, which there may be no memory for.

        Python itself waits for the threads at the exit.
        """
        self._threads.shutdown(wait=False)


async def _drive(
    settings: Settings, files: Files, sessions: Sessions, fitted: Callable[[BrakingMotor], None],
    joystick: LocalOperator | None,
) -> None:  # fmt: skip
    stop, asked = asyncio.Event(), asyncio.Event()
    _hear_signals(asked, stop)
    if files.restart is not None:
        files.restart.end = partial(_set, asked, stop)
    rehearsal = Rehearsal(settings, time.monotonic)
    car, bus, (motor, lidar) = _car(settings, files, sessions, fitted, joystick, rehearsal)
    opening = asyncio.create_task(_open(car, bus, stop, files.address), name="bus")
    rehearsal.warm_up()
    gc.collect()
    gc.freeze()  # a full collection would block the loop for milliseconds; the objects present now stay anyway
    await _hold(opening, asked)
    car.stages.watch_collections()
    lidar.tap, motor.tap = car.recorder.tap("lidar"), car.recorder.tap("motor")
    car.recorder.start()
    try:
        await car.drive(stop)
    finally:
        car.stages.ignore_collections()
        for line in car.stages.table():
            log.info("%s", line)
        car.manager.stopping()
        _leave_behind(lidar, motor)
        await _close(opening, bus, car.recorder.close, asked)
    if not opening.cancelled():
        opening.result()


def _hear_signals(*events: asyncio.Event) -> None:
    """Set the events at a signal that ends the car, and hold these handlers against user code."""
    loop = asyncio.get_running_loop()

    def hear() -> None:
        for number in STOP_SIGNALS:
            loop.add_signal_handler(number, _set, *events)

    STOP_SIGNALS_HELD.hold(hear)


def _car(
    settings: Settings, files: Files, sessions: Sessions, fitted: Callable[[BrakingMotor], None],
    joystick: LocalOperator | None, rehearsal: Rehearsal,
) -> tuple[Car, CarBus, Devices]:  # fmt: skip
    """Return the car, its bus and its devices; `fitted` gets the motor as soon as there is one."""
    clock, scan_phase = time.monotonic, ScanPhase()
    uplinks = [Uplink(router, settings.car.name) for router in sessions.routers]
    bus = _bus(sessions.own, uplinks, any_port=settings.telemetry.any_port)
    motor, lidar = devices = _devices(settings, clock, scan_phase)
    fitted(motor)
    if isinstance(lidar, TopicLidar):
        rehearsal.read = lidar.rehearse
    around = CarSurroundings(
        files.saved, files.base, lambda: lidar.reading_s, scan_phase, WallClock(clock), ComputerWatch(read_computer),
        joystick, rehearsal if settings.process.rehearse else None, _course(settings), files.restart,
    )  # fmt: skip
    car = Car(settings, lidar, motor, bus, clock, around)
    _hear_inertia(motor, car)
    for uplink in uplinks:
        uplink.session = session_text(car.session)
    if (history := settings.parameters.history_path) is not None:
        parameters.read_history(car.history, history)
    return car, bus, devices


def _course(settings: Settings) -> RaceCourse | None:
    """Return the course of the settings, None without a map; LaunchError for an unusable one."""
    try:
        course = read_course(settings.map, settings.car)
    except MapError as error:
        raise LaunchError(f"map: {error}") from None
    if course is not None:
        log.info("the pose is found on %s", settings.map.file)
    return course


def _devices(settings: Settings, clock: Clock, scan_phase: ScanPhase) -> Devices:
    motor = motor_for(settings.motor, clock=clock, clear_s=scan_phase.clear_s, replied=scan_phase.replied)
    motion = TurnMotion(settings.car, lambda: motor.state)
    return motor, lidar_for(settings.lidar, clock=clock, clear_s=scan_phase.clear_s, motion=motion)


def _hear_inertia(motor: Vesc | PwmMotor | OwnMotor, car: Car) -> None:
    if isinstance(motor, Vesc):
        motor.inertia.on_measurement = car.telemetry.on_imu


def _leave_behind(*devices: object) -> None:
    """Have the process end although a driver of the user does not."""
    if any(isinstance(one, OwnLidar | OwnMotor) and one.left_behind for one in devices):
        end_in_time(0)


def _bus(session: Mapping[str, Any], uplinks: Sequence[Uplink], *, any_port: bool) -> CarBus:
    return UplinkedBus(session, uplinks, any_port=any_port) if uplinks else CarBus(session, any_port=any_port)


def _set(*events: asyncio.Event) -> None:
    for event in events:
        event.set()


async def _hold(opening: asyncio.Task[None], asked: asyncio.Event) -> None:
    """Stand until the session has opened, HOLD_WITHIN_S are over, or an end is asked; LaunchError from the opening."""
    stopping = asyncio.create_task(asked.wait())
    await asyncio.wait({opening, stopping}, timeout=HOLD_WITHIN_S, return_when=asyncio.FIRST_COMPLETED)
    await end(stopping)
    if opening.done():
        opening.result()  # before anything moves or records


async def _close(
    opening: asyncio.Task[None], bus: CarBus, close_recorder: Callable[[], None], asked: asyncio.Event
) -> None:
    """Close the session and the recorder, the recorder also when the session cannot be closed.

    asked: to end; a session that still opens is then left.
    """
    try:
        await asyncio.wait({opening}, timeout=LEFT_AFTER_S if asked.is_set() else HOLD_WITHIN_S)
        if not opening.done():
            end_in_time(0)  # Python waits for its thread
            await end(opening)
        await bus.close()
    finally:
        close_recorder()  # the car stands, and a thread for it may not be had


async def _open(car: Car, bus: CarBus, stop: asyncio.Event, address_file: Path | None) -> None:
    """Open the session and report its address; LaunchError, after `stop`, when another program has its port."""
    telemetry = Address(car.settings.car.name, session_text(car.session))
    if not car.settings.telemetry.enabled:
        telemetry = replace(telemetry, problem="telemetry.enabled is false")
    else:
        car.connect()
        try:
            await bus.open()
        except PortTakenError as error:
            stop.set()
            raise LaunchError(taken_sentence(error.endpoint, await holder_of(error.endpoint))) from None
        except Exception as error:  # noqa: BLE001 - said at once; zenoh raises more than its documentation names
            log.error("driving without telemetry: %s", error)
            telemetry = replace(telemetry, problem=str(error))
        else:
            where, unheard = (bus.endpoint, "") if bus.endpoint else ("no address", "telemetry.listen is empty")
            log.info("telemetry on %s, session %s", where, telemetry.session)
            telemetry = replace(telemetry, endpoint=bus.endpoint, problem=unheard)
    if address_file is not None:
        try:
            await asyncio.to_thread(write_address, address_file, telemetry)
        except OSError as error:
            stop.set()
            raise LaunchError(f"--address-file {address_file}: cannot be written ({error.strerror})") from None
