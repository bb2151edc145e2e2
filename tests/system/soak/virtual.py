"""A whole car in virtual time over in-memory byte transports: the real drivers, tasks, queue, mux, laws and limiter.

Nothing of the car is replaced but the two functions that open a port, and the bus. What the oracle is told of the
inside (safety's answers, the car's state) is read, never changed.
"""

import asyncio
import math
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final
from unittest import mock

from tests.system.soak.findings import Findings
from tests.system.soak.oracle import Judged, Oracle, Promises
from tests.system.soak.scene import WIRING, MemoryLidar, MemoryVesc, Scene
from tests.system.soak.surroundings import (
    AUTO_MPS,
    FIRST_FAULT_S,
    VESC_TIMEOUT_A,
    VESC_TIMEOUT_S,
    SoakSurroundings,
)
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.link import ByteLink
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.realtime.scan_phase import ScanPhase
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire import topics
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.virtual_time import VirtualTimeLoop, run_virtual

ENDING_S: Final = 3.0


class OperatorsBus(MemoryBus):
    """Delivers beats to the operator, and keeps nothing."""

    on_beat: Callable[[bytes], None] = staticmethod(lambda _payload: None)

    def put(self, key: str, payload: bytes, *, encoding: str = "", urgent: bool = False) -> None:
        if key.endswith(topics.BEAT):
            self.on_beat(payload)


class VirtualSoak(SoakSurroundings):
    """One car in its surroundings. Needs a `VirtualTimeLoop`."""

    def __init__(self, seed: int, mean_pause_s: float = 10.0) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        self._loop = loop
        clock = loop.time
        lidar = MemoryLidar(clock=clock, seed=seed)
        vesc = MemoryVesc(
            Path("vesc"), clock=clock, timeout_s=VESC_TIMEOUT_S, timeout_brake_a=VESC_TIMEOUT_A, remember=1
        )
        vesc.start()
        self._ports = _memory_ports(lidar, vesc)
        super().__init__(clock, lidar, vesc, self._oracle, seed, mean_pause_s)
        self.bus = OperatorsBus(clock, listened_to=False)
        self.bus.on_beat = self.hear
        self.car = self._build_car()
        self._listen_to_safety()

    def _oracle(self, scene: Scene) -> Oracle:
        return Oracle(
            Promises(auto_mps=AUTO_MPS),
            lambda: scene.good_scan_s,
            knows_safety=True,
            state=lambda: (self.car.driving_state.state, self.car.driving_state.since_s),
        )

    def _build_car(self) -> Car:
        clock = self._clock
        settings = Settings.model_validate(
            {
                "car": {"name": "sim"},
                "motor": WIRING.model_dump() | {"address": "serial:///dev/memory"},
                "lidar": {"address": "tcp://127.0.0.1:1"},
                "battery": {"settle_s": 2.0},
                "wall_follow": {"speed_mps": AUTO_MPS},
                "recording": {"enabled": False},
            }
        )
        phase = ScanPhase()
        assert isinstance(settings.motor, VescSettings)
        motor = Vesc(settings.motor, clock=clock, clear_s=phase.clear_s, replied=phase.replied)
        assert isinstance(settings.lidar, HokuyoSettings)
        lidar = Hokuyo(settings.lidar, clock=clock, clear_s=phase.clear_s)
        car = Car(settings, lidar, motor, self.bus, clock, CarSurroundings(scan_phase=phase))
        car.connect()
        return car

    def _listen_to_safety(self) -> None:
        look, oracle, clock = self.car.laws.look, self.oracle, self._clock

        def looked(scan: Any, motor: Any) -> Any:
            answer = _Overheard(look(scan, motor), scan.stamp_s, oracle, clock)
            oracle.assessed(clock(), scan.stamp_s)
            return answer

        setattr(self.car.laws, "look", looked)  # noqa: B010 - the oracle listens, the law answers

    def carry(self, payload: bytes) -> None:
        """Deliver it at once."""
        self.bus.deliver(topics.key("sim", topics.COMMAND), payload)

    def block(self, for_s: float) -> None:
        """Let time pass in which no callback of the loop runs."""
        self._loop._jumping.now_s += for_s
        self.oracle.blocked(self._clock(), for_s)

    async def run(
        self, seconds: float, watch: Callable[[float], None] = lambda _now_s: None, sought: str = ""
    ) -> Findings:
        """Drive for so many virtual seconds, or until this rule is broken; watch: called every virtual minute."""
        found = self.oracle.violations
        clock, stop = self._clock, asyncio.Event()
        with self._ports:
            driving = self._loop.create_task(self.car.drive(stop))
            turning = self._loop.create_task(self.turn_lidar())
            operating = self._loop.create_task(self.operate())
            next_s = 60.0
            while clock() < seconds and not driving.done() and sought not in found:
                await asyncio.sleep(0.05)
                if clock() > FIRST_FAULT_S:
                    self.injector.step(clock())
                self.oracle.idle(clock())
                if clock() >= next_s:
                    next_s += 60.0
                    watch(clock())
            self.injector.end_all(clock())
            if driving.done():
                self.fault("the car ended by itself", repr(driving.exception()))
            await asyncio.sleep(0.0 if sought in found else ENDING_S)
            for task in (turning, operating):
                if task.done():
                    task.result()
                task.cancel()
            self.oracle.ending = True
            stop.set()
            if not driving.done():
                await driving
        return self.findings(clock())


class _Overheard:
    """Safety's answer, with the oracle as a listener."""

    def __init__(self, assessment: Any, scan_stamp_s: float, oracle: Oracle, clock: Callable[[], float]) -> None:
        self._assessment, self._stamp_s, self._oracle, self._clock = assessment, scan_stamp_s, oracle, clock

    def judge(self, speed_mps: float, steering_rad: float, memory: Any, promise: Promise | None = None) -> Any:
        verdict, memory = self._assessment.judge(speed_mps, steering_rad, memory, promise)
        self._oracle.judged(Judged(self._clock(), self._stamp_s, speed_mps, verdict.forward_mps, verdict.reverse_mps))
        return verdict, memory

    def __getattr__(self, name: str) -> Any:
        return getattr(self._assessment, name)


@contextmanager
def _memory_ports(lidar: MemoryLidar, vesc: MemoryVesc):
    def opener(connect: Callable[[], Any]) -> Any:
        async def open_link(address: Any, clock: Any, **_: Any) -> ByteLink:
            end = connect()
            return ByteLink(address, end.fileno(), lambda _lost: end.close(), clock)

        return open_link

    with ExitStack() as stack:
        for module, connect in (
            ("wallride.drivers.lidar", lidar.connect),
            ("wallride.drivers.vesc.driver", vesc.connect),
        ):
            stack.enter_context(mock.patch(f"{module}.open_link", opener(connect)))
        yield


def soak(
    seconds: float, seed: int, mean_pause_s: float = 10.0, watch: Callable[[float], None] = lambda _now_s: None
) -> Findings:
    """Run one soak in virtual time."""

    async def main() -> Findings:
        return await VirtualSoak(seed, mean_pause_s).run(seconds, watch)

    return run_virtual(main())


def suffer(
    fault: str = "", *, begins_s: float = 3.5, lasts_s: float = 2.0, runs_s: float = 7.5,
    prepare: Callable[[VirtualSoak], None] = lambda _soak: None, sought: str = "",
) -> Findings:  # fmt: skip
    """Drive with at most this one fault. prepare: changes the soak before it begins. sought: a rule that ends it."""

    async def main() -> Findings:
        soak = VirtualSoak(1, math.inf)
        prepare(soak)
        loop, injector = asyncio.get_running_loop(), soak.injector
        if fault:
            loop.call_at(begins_s, injector.begin, fault, begins_s)
            loop.call_at(begins_s + 1e-3, injector.active.__setitem__, fault, math.inf)
            loop.call_at(begins_s + lasts_s, lambda: injector.end(fault, loop.time()))
        return await soak.run(runs_s, sought=sought)

    return run_virtual(main())
