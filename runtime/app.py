"""The composition root: the one place where devices, queues and tasks meet. `drive` shows the dataflow."""

import asyncio
import logging
import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wallride.drivers.api import Clock, Lidar, Motor, Scan
from wallride.runtime import kernel
from wallride.runtime.arbitration.command import Output
from wallride.runtime.arbitration.driving_state import DrivingStateMonitor
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.arbitration.inbox import Inbox
from wallride.runtime.arbitration.obedience import Obedience
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.ending import end
from wallride.runtime.host.systemd import ServiceManager
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.restart import Restart, RestartDesk
from wallride.runtime.parameters.server import ParameterServer, ServerContext
from wallride.runtime.realtime.garbage import collect_young
from wallride.runtime.realtime.periodic import PeriodicTimer
from wallride.runtime.realtime.scan_phase import ScanPhase
from wallride.runtime.realtime.stage_timing import StageTimer
from wallride.runtime.realtime.wall_clock import WallClock, never_set
from wallride.runtime.recording.own_parts_memory import file_in
from wallride.runtime.recording.recorder import Recorder
from wallride.runtime.rehearsal import Rehearsal
from wallride.runtime.ros.graph import DRIVE
from wallride.runtime.scan_topic import TopicLidar
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks import health, operator, parameters, recorder, safety, scan_speed, wall_follow
from wallride.runtime.tasks import lidar as lidar_task
from wallride.runtime.tasks import mux as mux_task
from wallride.runtime.tasks.battery import BatteryLimit
from wallride.runtime.tasks.computer import ComputerWatch
from wallride.runtime.tasks.health import HealthMonitor
from wallride.runtime.tasks.own_law import OwnLawWatch
from wallride.runtime.tasks.own_parts import OwnPartsKeeper
from wallride.runtime.tasks.pose import PoseTeller
from wallride.runtime.tasks.scan_cycle import ScanCycle
from wallride.runtime.tasks.standstill import Standstill
from wallride.runtime.tasks.telemetry import Telemetry
from wallride.runtime.telemetry.ros2_sink import Ros2Sink
from wallride.runtime.telemetry.sinks import Sink, ZenohSink
from wallride.runtime.telemetry.status import ObservedState
from wallride.runtime.telemetry.topic_writers import laser_frame
from wallride.runtime.teleop.desk import OperatorDesk
from wallride.runtime.teleop.local_operator import LocalOperator
from wallride.runtime.teleop.planners import PlannerDesk
from wallride.runtime.wire import topics
from wallride.runtime.wire.car_bus import POLL_HZ
from wallride.runtime.wire.network import BYTES, Network
from wallride.runtime.wire.rmw_zenoh import MAX_DRIVE_B
from wallride.runtime.wire.teleop import COMMAND_BYTES

log = logging.getLogger("wallride.app")

FOLLOW_WALL_CLOCK_S = 1.0


@dataclass(frozen=True, slots=True)
class CarSurroundings:
    """What a car has beside its devices.

    file: destination of saved live parameters, None where there is none; base: the file below it.
    reading_s: duration of the newest scan's read from the kernel, where the lidar measures it.
    scan_phase: the one around which the devices schedule. wall_clock: the computer's, where it may be set.
    computer: watches the computer, where there is a real one. joystick: a gamepad on the car itself.
    course: the map with its pose and line, where there is one. restart: of its process, where it is one.
    rehearsal: what is done between two scans, where the process has the computer to itself.
    """

    file: Path | None = None
    base: Path | None = None
    reading_s: Callable[[], float] = lambda: 0.0
    scan_phase: ScanPhase = field(default_factory=ScanPhase)
    wall_clock: WallClock | None = None
    computer: ComputerWatch | None = None
    joystick: LocalOperator | None = None
    rehearsal: Rehearsal | None = None
    course: RaceCourse | None = None
    restart: Restart | None = None


class Car:
    """The shared objects of one drive. Built once, from settings and two devices; `drive` runs it."""

    def __init__(
        self,
        settings: Settings,
        lidar: Lidar,
        motor: Motor,
        bus: Network,
        clock: Clock,
        around: CarSurroundings | None = None,
    ) -> None:
        around = around or CarSurroundings()
        self.settings = settings
        self.lidar = lidar
        self.motor = motor
        self.bus = bus
        self.clock = clock
        self.manager = ServiceManager()
        self.wall_clock, self._clock_trouble = around.wall_clock or never_set(clock), ""
        self.recorder = Recorder(
            settings.recording,
            car=settings.car.name,
            version=version("wallride"),
            wall_clock=self.wall_clock,
            clock=clock,
        )
        self.decision_log = self.recorder.decision_log
        # Deciding code reads the time from the decision log, so that a replay can return the very same readings.
        self.stack = LiveStack(settings, self.decision_log, around.course)
        self.queue, self.laws, self.limiter = self.stack.queue, self.stack.laws, self.stack.limiter
        self.stages, self._reading_s, self.scan_phase = StageTimer(clock), around.reading_s, around.scan_phase
        self.mux = mux_task.Mux(
            self.queue, motor, self.limiter, REQUIRED, self.decision_log.clock, self.stages, self.decision_log,
            self.stack.heed,
        )  # fmt: skip
        self.standstill = Standstill(motor, lambda: self.mux.output, clock)
        self.pose = PoseTeller(around.course.name, lambda: self.laws.race) if around.course is not None else None
        self.joystick, self.computer, self._rehearsal = around.joystick, around.computer, around.rehearsal
        self._add_people()
        self._add_watches()
        self.history = ChangeHistory(settings.parameters.history)
        self.parameters = ParameterServer(settings, self._surroundings(around.file, around.base), self.history)
        self.restart = RestartDesk(self._why_no_restart, around.restart)
        self._add_telemetry(around.course)

    def _add_people(self) -> None:
        """Add what asks for motion from outside the laws: operators, planners, their permit and the e-stop."""
        settings, clock = self.settings, self.clock
        self.permit = Permit(self.queue, settings.operator.permit)
        self.emergency_stop = EmergencyStop(self.queue)
        self.session = secrets.randbits(31) + 1
        self.operator = OperatorDesk(
            settings.operator, self.queue, self.permit, self.emergency_stop, self.motor.clear_fault, clock,
            car_session=self.session,
        )  # fmt: skip
        self.planners = PlannerDesk(
            settings.planner_names(), settings.planners.expiry_s, self.queue, self.permit, self.operator.beats,
            self.operator.rearm, clock, self.session,
        )  # fmt: skip
        self.operator.heard_elsewhere = lambda: self.planners.is_attended

    def _add_watches(self) -> None:
        """Add what looks at devices, laws and battery, and limits or names what it finds."""
        settings, lidar, motor, clock = self.settings, self.lidar, self.motor, self.clock
        self.scan_speed = scan_speed.SpeedByScans(motor, settings.car, self.queue)
        self.battery = BatteryLimit(settings.battery, motor, self.queue, self.operator.rearm)
        self.obedience = Obedience()
        self.own_law = OwnLawWatch(
            self.laws, self.permit, self.operator.rearm, lambda: self.stack.apply(self.stack.settings), clock
        )
        self.driving_state = DrivingStateMonitor(
            lidar, motor, self.emergency_stop, self.permit, clock, lambda: self.battery.stop
        )
        self.driving_state.own_law = lambda: self.laws.own_law_fault
        self.driving_state.slowest_mps = settings.motor.min_speed_mps
        self.own_parts = OwnPartsKeeper(
            settings.car.name, lambda: lidar.health.identity, self.laws, file_in(settings.process.state_folder), clock,
            lambda: datetime.now(UTC).isoformat(timespec="seconds"), self.standstill.holds,
            self.decision_log.add_own_parts,
        )  # fmt: skip

    def _add_telemetry(self, course: RaceCourse | None) -> None:
        """Add the topics and where they go."""
        bus, settings = self.bus, self.settings
        self.sink = ZenohSink(bus, settings.car.name, settings.telemetry.rates_hz)
        self.ros2 = self._ros2_sink()
        sinks: list[Sink] = [self.sink, self.recorder, *([self.ros2] if self.ros2 is not None else [])]
        self.telemetry = Telemetry(
            self._observed(), settings.car, sinks,
            wall_clock=self.wall_clock, side=lambda: self.settings.wall_follow.side, ball_m=lambda: self.laws.path_m,
        )  # fmt: skip
        self.side_work = self.telemetry.side_work
        self._noticing = self.laws, self.scan_speed, self.own_law, self.side_work, self.obedience
        if self.pose is not None:
            self.pose.publish = self.telemetry.on_pose
        if course is not None:
            self.side_work.guarded("telemetry", self.telemetry.on_course)(course)

    def connect(self) -> None:
        """Declare the incoming keys on the bus: an operator's commands and requests about parameters."""
        name = self.settings.car.name
        self.bus.announce(topics.key(name, topics.ALIVE))
        self.bus.subscribe(topics.key(name, topics.COMMAND), self.operator.receive, max_bytes=COMMAND_BYTES)
        for planner in self.settings.planner_names():
            self.bus.subscribe(topics.planner_key(name, planner), self.planners.receive, max_bytes=COMMAND_BYTES)
        if (graph := self.settings.ros2_graph()) is not None and self.settings.ros2.drive:
            drive = graph.data_key(DRIVE)
            self.bus.subscribe_attached(drive, self.planners.receive_ros, max_bytes=MAX_DRIVE_B)
            self.bus.subscribe(graph.any_type_key(DRIVE), partial(self.planners.refuse_other_type, drive))
        if graph is not None and isinstance(self.lidar, TopicLidar):
            self.lidar.listen(self.bus, graph)
        parameters.serve(self.bus, name, self.parameters, self.restart)
        recorder.serve(self.bus, name, self.recorder)
        self.bus.answer(topics.key(name, f"{topics.OWN_PARTS}/show"), self.own_parts.answer_show)
        self.bus.answer(topics.key(name, f"{topics.OWN_PARTS}/forget"), self.own_parts.answer_forget)

    def apply(self, settings: Settings, changed: Sequence[str]) -> None:
        """Apply other settings in one step of the loop: between two scans, never within one."""
        self.settings = settings
        self.stack.apply(settings)
        if self._rehearsal is not None:
            self._rehearsal.apply(settings)
        self.sink.limit(settings.telemetry.rates_hz)
        if self.ros2 is not None:
            self.ros2.limit(settings.telemetry.rates_hz)
        if "log.level" in changed:
            logging.getLogger().setLevel(settings.log.level)

    def status(self) -> Mapping[str, Any]:
        """Return the answer to "why is it (not) moving" as plain values."""
        return self.telemetry.status()

    def _why_no_restart(self) -> str:
        if self.emergency_stop.latched:
            return "the e-stop is on, and a start would forget it: clear it first"
        return "" if self.standstill.holds() else "only while the car stands; stop it first"

    async def drive(self, stop: asyncio.Event) -> None:
        """Drive until `stop` is set or a task fails; the car is brought to rest on every way out."""
        async with asyncio.TaskGroup() as devices:
            keeper = devices.create_task(self.motor.run(), name="motor")
            try:
                async with asyncio.TaskGroup() as tasks:
                    driving = self._start(tasks)
                    tasks.create_task(_until(stop, driving), name="stop")
            finally:
                await self.standstill.reach()
                await end(keeper)

    def _start(self, tasks: asyncio.TaskGroup) -> list[asyncio.Task[Any]]:
        motor, kept_in = self.motor, self.settings.parameters.history_path
        for_safety, for_follower = Inbox[Scan](), Inbox[Scan]()
        beside, guarded = self.side_work, self.side_work.guarded
        cycle = ScanCycle(
            self.stages.follow, self.mux.decide_now, beside.guarded("telemetry", self.telemetry.on_guidance),
            [self.scan_speed.learn, guarded("learning", self._learn), guarded("timing", self._afterwards)],
        )  # fmt: skip
        jobs = {
            "lidar": lidar_task.pump(
                self.lidar,
                [
                    self.own_parts.meet, self.decision_log.add_scan,
                    beside.guarded("telemetry", self.telemetry.on_scan), for_safety.put, for_follower.put,
                ],
                timed=lambda scan: self.stages.on_scan(scan.received_s, self._reading_s()),
            ),
            "safety": safety.watch(for_safety, motor, self.stack.look, self.stages.safety),
            "wall_follow": wall_follow.follow(for_follower, motor, self.stack.follow, cycle),
            "mux": self.mux.run(beside.guarded("telemetry", self._publish)),
            "timer": self._periodic_timer().run(),
            "own_parts": beside.keep("the file of own parts", self.own_parts.keep),
            "parameters": beside.keep(
                "the history of parameters", lambda: parameters.keep_history(self.history, kept_in)
            ),
            "telemetry": beside.keep("telemetry", self.telemetry.run),
        }  # fmt: skip
        if self.computer is not None:
            jobs["computer"] = beside.keep("watching the computer", self.computer.watch)
        if self.joystick is not None:
            jobs["joystick"] = beside.keep("looking for gamepads", self.joystick.watch)
        return [tasks.create_task(job, name=name) for name, job in jobs.items()]

    def _publish(self, output: Output) -> None:
        self.driving_state.update(output)
        self.telemetry.on_output(output)

    def _learn(self, scan: Scan) -> None:
        self.laws.learn()
        if self.pose is not None and (estimate := self.stack.locate(scan)) is not None:
            self.pose.tell(estimate)
        self.telemetry.learn(scan)

    def _afterwards(self, scan: Scan) -> None:
        """Do what can wait until a scan is answered."""
        collect_young()
        self.stages.count()
        self.scan_phase.arrived(scan.received_s)
        if self._rehearsal is not None:
            self._rehearsal.plan(scan, self.motor.state, self.mux.output, self.scan_phase.next_s)

    def _beat(self, beat: bytes) -> None:
        self.bus.put(topics.key(self.settings.car.name, topics.BEAT), beat, encoding=BYTES, urgent=True)
        if self.joystick is not None:
            self.joystick.hear(beat, self.clock())

    def _ask_joystick(self, _late_s: float, _missed: int) -> None:
        if self.joystick is not None and (command := self.joystick.command(self.clock())) is not None:
            self.operator.receive("", command, self.clock())

    def _periodic_timer(self) -> PeriodicTimer:
        """Return the timer of the periodic jobs."""
        settings, clock = self.settings, self.clock
        timer = PeriodicTimer(clock, self.scan_phase.clear_s)
        silence = mux_task.SilenceTick(self.queue, settings.mux.tick_hz, clock, self.stages.on_tick)
        timer.every(1 / settings.mux.tick_hz, silence.tick)
        timer.every(1 / settings.operator.beat_hz, operator.DeskTicker(self.operator, self.motor, self._beat).tick)
        if self.joystick is not None:
            timer.every(1 / settings.operator.beat_hz, self._ask_joystick)
        if settings.planners.enabled:
            timer.every(1 / settings.operator.beat_hz, lambda _late_s, _missed: self.planners.tick())
        poll = self.side_work.guarded("polling the network", self.bus.poll)
        timer.every(1 / POLL_HZ, lambda _late_s, _missed: poll())
        for tick in (self._health_monitor().tick, self.battery.tick, self.standstill.tick, self.own_law.tick):
            timer.every(1 / health.RATE_HZ, tick)
        follow_wall_clock = self.side_work.guarded("following the computer's clock", self._follow_wall_clock)
        timer.every(FOLLOW_WALL_CLOCK_S, lambda _late_s, _missed: follow_wall_clock())
        return timer

    def _follow_wall_clock(self) -> None:
        if step_ns := self.wall_clock.follow():
            log.warning("the computer's clock was set by %+.3f s; stamps and recordings follow", step_ns / 1e9)
        if (trouble := self.wall_clock.trouble) != self._clock_trouble:
            self._clock_trouble = trouble
            log.warning("%s", trouble or "the computer's clock is right again")

    def _health_monitor(self) -> HealthMonitor:
        monitor = HealthMonitor(
            lidar=self.lidar, motor=self.motor, output=lambda: self.mux.output, emergency_stop=self.emergency_stop,
            rearm=self.operator.rearm, manager=self.manager, clock=self.clock,
            retry_faults=self.settings.operator.permit == "always",
            lidar_doubt=lambda: self.laws.plausibility.lidar_doubt,
            motor_doubt=lambda: self.laws.plausibility.motor_doubt, obedience=self.obedience,
        )  # fmt: skip
        self.operator.waits = monitor.is_waiting
        return monitor

    def _observed(self) -> ObservedState:
        return ObservedState(
            car=self.settings.car.name, version=version("wallride"), session=self.session,
            hot_path=kernel.state().words, lidar=self.lidar, motor=self.motor, queue=self.queue, clock=self.clock,
            seconds_by_winner=self.mux.seconds_by_winner,
            window=lambda: tuple(word for one in self._noticing for word in one.words),
            timings=self.stages,
            recording=self.recorder.status,
            own_parts=self.own_parts.status,
            condition=self.driving_state.fields,
            slowest_mps=self.settings.motor.min_speed_mps,
            battery=self.battery.status,
            computer=self.computer.status if self.computer is not None else dict,
            pose=self.pose.status if self.pose is not None else dict,
            operator=self.operator.view,
            held=lambda: self.operator.command,
            planners=self.planners.status,
            link=lambda: {"endpoint": self.bus.endpoint, "open": self.bus.is_open, "dropped": self.bus.dropped},
            routers=lambda: self.bus.routers,
            view=lambda: self.laws.perception.newest_view,
        )  # fmt: skip

    def _ros2_sink(self) -> Ros2Sink | None:
        if (graph := self.settings.ros2_graph()) is None:
            return None
        rates, laser = self.settings.telemetry.rates_hz, laser_frame(self.settings.car)
        return Ros2Sink(self.bus, graph, rates, laser, wall_clock=self.wall_clock, drives=self.settings.ros2.drive)

    def _surroundings(self, file: Path | None, base: Path | None) -> ServerContext:
        return ServerContext(
            apply=self.apply,
            is_standing=self.standstill.holds,
            clock=self.clock,
            date=lambda: datetime.now(UTC).isoformat(timespec="seconds"),
            file=file,
            base=base,
            may_loosen=self.settings.operator.loosen_safety_while_driving,
        )


async def _until(stop: asyncio.Event, tasks: list[asyncio.Task[Any]]) -> None:
    """End the tasks once `stop` is set or one has failed: a group of tasks asks only once.

    A task that was cancelled before is an error: nothing else would tell of it.
    """
    asked = asyncio.ensure_future(stop.wait())
    waiting: set[asyncio.Task[Any]] = {asked, *tasks}
    try:
        while not stop.is_set():
            ended, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            if cancelled := [task.get_name() for task in ended if task.cancelled()]:
                raise RuntimeError(f"the task {cancelled[0]} was cancelled while the car drives")
        log.info("asked to stop")
    finally:
        await end(asked, *tasks)
