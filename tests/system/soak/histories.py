"""Random histories of the whole car in virtual time: the unmodified tasks between devices in memory.

Two operators, three planners (one of them ROS 2's), parameters, an own law, devices and the process itself do what the
dice say, several of them at one step; `history_rules` judges. One seed is one history.
"""

import asyncio
import json
import random
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

from tests.system.soak.history_rules import LEASE_S, Judge, Moved
from tests.system.soak.history_sender import Sender
from wallride.drivers.api import LinkState
from wallride.laws import Guidance, LawSettings
from wallride.runtime.app import Car
from wallride.runtime.arbitration.command import Output
from wallride.runtime.control.own_laws import law_class
from wallride.runtime.parameters.update import UnacceptableError
from wallride.runtime.ros import messages
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire import topics
from wallride.runtime.wire.rmw_zenoh import ROS2_PLANNER, attachment
from wallride.runtime.wire.teleop import CarCondition, Command, Press, read_beat
from wallride.sim.virtual.devices import MemoryBus, MemoryLidar, MemoryMotor, ranges_between_walls
from wallride.sim.virtual.virtual_time import VirtualTimeLoop, run_virtual

STEP_S: Final = 0.0203
"""No divisor of a scan, a beat or a lease, so that events meet them in every phase."""
SEND_STEPS: Final = 2
STEPS: Final = (150, 350)
CORRIDOR: Final = ranges_between_walls(1.0, 1.0)
PLANNERS: Final = ("alpha", "beta", ROS2_PLANNER)
LAW: Final = "random_history:Law"
SURELY_LOST_S: Final = 0.2  # in which the process sees a change of a device: four health ticks
SHARES: Final = (0.75, 0.16, 0.06, 0.03)
"""Share of the steps at which nothing happens, one thing, two, three."""


@dataclass
class Found:
    """Sums over histories. kept: first violations, with seeds. moved: moving commands by driver. events: how often."""

    histories: int = 0
    seconds: float = 0.0
    violations: Counter[str] = field(default_factory=Counter)
    kept: list[str] = field(default_factory=list)
    moved: Counter[str] = field(default_factory=Counter)
    incidents: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)

    def add(self, history: "History") -> None:
        """Add one that is over."""
        judge = history.judge
        self.histories += 1
        self.seconds += history.clock()
        self.kept += [f"seed {history.seed}: {line}" for line in judge.kept]
        self.violations.update(judge.violations)
        self.moved.update(judge.moved)
        self.incidents.update(judge.incidents)
        self.events.update(history.events)


class Law:
    """An own law that raises when the history says so."""

    world: ClassVar["History"]

    class Settings(LawSettings):
        """One setting, to be changed while it drives."""

        gain: float = 1.0

    def __init__(self, settings: Any, car: Any) -> None:
        self.settings, self.broken = settings, False
        self.world.judge.law_broken = False

    def follow(self, scan: Any, state: Any) -> Guidance:
        if self.world.law_raises:
            self.world.law_raises = False
            self.world.judge.law_raised()
            raise ValueError("the dice said so")
        return Guidance(state.desired_speed_mps, 0.0)


class Bus(MemoryBus):
    """Delivers the car's beats, and keeps nothing."""

    on_beat: Callable[[bytes], None] = staticmethod(lambda _payload: None)

    def put(self, key: str, payload: bytes, *, encoding: str = "", urgent: bool = False) -> None:
        if key.endswith(topics.BEAT):
            self.on_beat(payload)

    def put_attached(self, key: str, payload: bytes, *, encoding: str, attachment: bytes) -> None:
        """Keep nothing."""

    put_latched = put_attached


class History:
    """One history. Needs a `VirtualTimeLoop`."""

    def __init__(self, seed: int) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        self.rng, self.loop, self.clock = random.Random(seed), loop, loop.time
        self.seed = seed
        self.judge = Judge(loop.time, PLANNERS)
        self.law_raises = False
        self.events: Counter[str] = Counter()
        self._marks = 0
        self._away: dict[str, float] = {}
        self._seen_s = SURELY_LOST_S
        self.ros_on, self._ros_since_s, self._ros_s, self._ros_sequence = False, 0.0, -10.0, 0
        self.operators = [Sender("ann", 1), Sender("bob", 2)]
        self.planners = [Sender("alpha", 11), Sender("beta", 12)]
        Law.world = self
        self.car = self._built()
        self.stop = asyncio.Event()

    def _built(self) -> Car:
        law_class.register("wall_follow", LAW, Law)
        settings = Settings.model_validate(
            {
                "battery": {"settle_s": 0}, "recording": {"enabled": False},
                "car": {"max_acceleration_mps2": 20.0},
                "operator": {"permit": "required"},
                "planners": {"enabled": True, "names": PLANNERS[:2]},
                "ros2": {"enabled": True, "drive": True},
                "wall_follow": {"method": LAW, "speed_mps": 1.0},
                "safety": {"method": "report", "odometry_check": False},  # the scans do not move with the car
            }
        )  # fmt: skip
        self.motor = MemoryMotor(self.clock)
        self.lidar = MemoryLidar(self._scan, self.clock)
        self.bus = Bus(self.clock, listened_to=False)
        self.bus.on_beat = self._hear
        car = Car(settings, self.lidar, self.motor, self.bus, self.clock)
        car.connect()
        setattr(car.telemetry, "on_output", self._sent)  # noqa: B010 - the judge listens in telemetry's place
        return car

    async def run(self) -> None:
        """Let it happen."""
        driving = self.loop.create_task(self.car.drive(self.stop))
        self.right(self.rng.choice(self.operators), Press.AUTONOMY)
        for step in range(self.rng.randint(*STEPS)):
            await asyncio.sleep(STEP_S)
            for _ in range(self.rng.choices(range(4), SHARES)[0]):
                self._happen()
            self._say(step)
        self.judge.asked_to_stop()
        self.stop.set()
        try:
            await driving
        except Exception as error:  # noqa: BLE001 - whatever ends the car is a finding
            self.judge.violations[f"the car ended by itself: {error!r}"] += 1
        if self.motor.present:
            self.judge.ended(self.motor.wire[-1][1].speed_mps)

    # What the car says and hears.

    def _hear(self, payload: bytes) -> None:
        beat = read_beat(payload)
        self.judge.beat(beat.beat, beat.operator_session, permitted=bool(beat.flags & CarCondition.PERMITTED))
        for sender in (*self.operators, *self.planners):
            sender.hear(beat)

    def _scan(self, now_s: float) -> Any:
        if "lidar" in self._away:
            return None
        self.judge.scan_s = now_s
        return CORRIDOR

    def _sent(self, output: Output) -> None:
        decision = output.decision
        if output.delivered:
            mark = decision.steering_rad if decision.steering_rad is not None else 0.0
            self.judge.sent(Moved(output.stamp_s, output.drive.speed_mps, str(decision.driver or ""), mark))

    def _mark(self) -> float:
        """Return the next steering angle that no other command asks for; exact in the wire's 32 bits."""
        self._marks += 1
        return (self._marks % 16384) / 16384

    def _say(self, step: int) -> None:
        for index, sender in enumerate((*self.operators, *self.planners)):
            sender.turn()
            if (step + index) % SEND_STEPS == 0 and (command := sender.make(self._mark())) is not None:
                if sender.late is not None:
                    sender.late.append(command)
                else:
                    self._deliver(sender, command)
        if self.ros_on and step % SEND_STEPS == 0:
            self._say_by_ros()

    def _deliver(self, sender: Sender, command: Command) -> None:
        said = command.session, command.sequence, command.beat, int(command.flags), command.steering_rad
        name = self.car.settings.car.name
        if sender in self.operators:
            self.judge.pressed(*said)
            self.bus.deliver(topics.key(name, topics.COMMAND), command.pack())
        else:
            self.judge.planned(sender.name, *said)
            self.bus.deliver(topics.planner_key(name, sender.name), command.pack())

    def _say_by_ros(self) -> None:
        now_s, mark = self.clock(), self._mark()
        if now_s - self._ros_s > 1.0:
            self._ros_since_s = now_s
        self._ros_s = now_s
        self._ros_sequence += 1
        if now_s - self._ros_since_s >= 0.5:
            self.judge.planned_by_ros(ROS2_PLANNER, now_s + LEASE_S, mark)
        note = attachment(self._ros_sequence, round(now_s * 1e9), b"r" * 16)
        self.car.planners.receive_ros(messages.ackermann(0, 0.6, mark), note, now_s)

    # What happens.

    def _happen(self) -> None:
        names = list(EVENTS)
        name = self.rng.choices(names, [EVENTS[each][0] for each in names])[0]
        self.events[name] += 1
        EVENTS[name][1](self)

    def someone(self) -> Sender:
        return self.rng.choice(self.operators)

    def planner(self) -> Sender:
        return self.rng.choice(self.planners)

    def right(self, sender: Sender, then: Press) -> None:
        """Do what a person does after an incident: release, reset, release, press."""
        acts = [Press(0), Press.RESET, Press(0)] if self.rng.random() < 0.6 else [Press(0)]
        sender.deaf, sender.late = False, None
        sender.next_holds = [*((act, self.rng.randint(2, 5)) for act in acts), (then, 1)]

    def once(self, sender: Sender, flags: Press) -> None:
        """Hold something else for a moment."""
        sender.next_holds = [(flags, self.rng.randint(1, 3)), (sender.holds, 1)]

    def leave(self, sender: Sender) -> None:
        """Say goodbye, and begin a new session at the next time."""
        sender.next_holds = []
        for _ in range(3):
            sender.holds = Press.GOODBYE
            if (command := sender.make(0.0)) is not None and sender.late is None:
                self._deliver(sender, command)
        self.anew(sender)

    def anew(self, sender: Sender) -> None:
        """Start the client again: it holds nothing, and says nothing until it is told to."""
        sender.session, sender.sequence, sender.holds = self.rng.getrandbits(60) | 1, 0, None
        sender.next_holds, sender.late, sender.deaf = [], None, False

    def link(self, sender: Sender) -> None:
        """Hold a link back, or deliver all that it held back, at once."""
        if sender.late is None:
            sender.late = []
            return
        waiting, sender.late = sender.late, None
        for command in waiting:
            self._deliver(sender, command)

    def replay(self, sender: Sender) -> None:
        """Deliver a forged copy of the last command, with what was held before."""
        if sender.holds is not None and sender.sequence:
            for command in 2 * [sender.make(self._mark())]:
                if command is not None:
                    self._deliver(sender, command)

    def toggle(self, device: str) -> None:
        """Unplug a device, or put it back."""
        if self.clock() < self._seen_s:
            return  # it is not lost before the car has seen it
        if device not in self._away:
            self._away[device] = self.clock()
            self._show(device, LinkState.ABSENT)
            if device == "motor":
                self.judge.gone()
            return
        if self.clock() - self._away.pop(device) >= SURELY_LOST_S:
            self.judge.returned(device)
        self._show(device, LinkState.READY)

    def _show(self, device: str, link: LinkState) -> None:
        if device == "lidar":
            self.lidar.health.link = link
        else:
            self.motor.present = link is LinkState.READY

    def fault(self) -> None:
        """Show a fault of the motor controller."""
        if self.motor.present and not self.motor.fault:
            self.motor.inject_fault("over voltage")
            self.judge.motor_faulted()

    def stall(self) -> None:
        """Keep the process from doing anything for a time."""
        seconds = self.rng.choice([0.03, 0.1, 0.19, 0.25, 0.6])
        if self.clock() < self._seen_s:
            self._seen_s += seconds
        self.loop._jumping.now_s += seconds
        self.judge.stalled(seconds)

    def tune(self) -> None:
        """Change a parameter, of the law or of something else."""
        name, value = self.rng.choice(
            [
                ("wall_follow.speed_mps", self.rng.choice([0.7, 1.0, 1.3])),
                ("wall_follow.own.gain", self.rng.random()),
                ("operator.expiry_s", 0.2), ("telemetry.rates_hz.scan", self.rng.choice([5.0, 10.0])),
                ("safety.stop_below_m", self.rng.choice([0.3, 0.4])),
            ]
        )  # fmt: skip
        try:
            self.car.parameters.set_some(json.dumps({"values": {name: value}, "by": "ann"}).encode())
        except UnacceptableError:
            self.events["refused parameter"] += 1


Act = Callable[[History], None]
EVENTS: Final[dict[str, tuple[float, Act]]] = {
    "permit": (9.0, lambda it: it.right(it.someone(), Press.AUTONOMY)),
    "by hand": (4.0, lambda it: it.right(it.someone(), Press.MANUAL)),
    "hold permit": (2.0, lambda it: setattr(it.someone(), "holds", Press.AUTONOMY)),
    "hold by hand": (2.0, lambda it: setattr(it.someone(), "holds", Press.MANUAL)),
    "let go": (2.0, lambda it: setattr(it.someone(), "holds", Press(0))),
    "e-stop": (1.5, lambda it: it.once(it.someone(), Press.ESTOP)),
    "reset": (1.0, lambda it: it.once(it.someone(), Press.RESET)),
    "take over": (0.7, lambda it: it.once(it.someone(), Press.TAKE_OVER)),
    "unsure": (0.7, lambda it: it.once(it.someone(), Press.UNSURE)),
    "operator leaves": (0.8, lambda it: it.leave(it.someone())),
    "operator silent": (1.0, lambda it: setattr(it.someone(), "holds", None)),
    "operator anew": (0.5, lambda it: it.anew(it.someone())),
    "operator deaf": (0.7, lambda it: setattr(it.someone(), "deaf", True)),
    "operator's link": (1.0, lambda it: it.link(it.someone())),
    "operator twice": (0.7, lambda it: it.replay(it.someone())),
    "planner drives": (6.0, lambda it: setattr(it.planner(), "holds", Press.MANUAL)),
    "planner stands": (3.0, lambda it: setattr(it.planner(), "holds", Press(0))),
    "planner leaves": (4.0, lambda it: it.leave(it.planner())),
    "planner silent": (3.0, lambda it: setattr(it.planner(), "holds", None)),
    "planner's link": (1.0, lambda it: it.link(it.planner())),
    "planner hears": (1.0, lambda it: setattr(it.planner(), "deaf", False)),
    "planner deaf": (0.5, lambda it: setattr(it.planner(), "deaf", True)),
    "ROS 2": (1.5, lambda it: setattr(it, "ros_on", not it.ros_on)),
    "parameter": (3.0, History.tune),
    "law raises": (1.5, lambda it: setattr(it, "law_raises", True)),
    "lidar": (1.0, lambda it: it.toggle("lidar")),
    "motor": (0.8, lambda it: it.toggle("motor")),
    "motor fault": (0.7, History.fault),
    "stall": (1.0, History.stall),
}
"""Weight of each event, and what it does."""


def tell(seeds: Iterable[int], watch: Callable[[Found], bool] = lambda _found: True) -> Found:
    """Run the histories of these seeds. watch: called after each; False ends it."""
    found = Found()

    async def one(seed: int) -> None:
        history = History(seed)
        await history.run()
        found.add(history)

    for seed in seeds:
        run_virtual(one(seed))
        if not watch(found):
            break
    return found
