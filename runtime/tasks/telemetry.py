"""Off the hot path: notes what the tasks show, and has it written when the motor has its command.

The hot path only leaves references, one slot per topic, the new replacing the old. A decision wakes the task, and a
decision comes after the motor was written; then messages are written for at most TURN_S per turn of the loop, so that
whatever arrives meanwhile waits hardly longer. What nobody wants is not written at all.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Iterator, Sequence
from functools import partial
from typing import Any, Literal, Never

from drivers.api import Scan
from runtime import snapshot, wire
from runtime.car_settings import CarSettings
from runtime.command import Output
from runtime.control.guidance import Guidance
from runtime.control.odometry import Odometry
from runtime.ros.definitions import TYPES
from runtime.ros.messages import NS, Floats
from runtime.sinks import Sink
from runtime.snapshot import Observed
from runtime.topic_writers import Message, Newest, TopicWriters, Vector

BY_SCAN = (wire.SCAN,)
BY_GUIDANCE = (wire.DISTANCE_ERROR, wire.WALL)
BY_MOTOR = (wire.ODOM, wire.TF, wire.MOTOR, wire.BATTERY)
BY_OUTPUT = (
    wire.OUTPUT, wire.DECISION, wire.STATUS, wire.SAFETY, wire.NAVIGATION, wire.TELEOP, wire.FOOTPRINT,
    wire.DIAGNOSTICS,
)  # fmt: skip
TURN_S = 0.0002
"""A turn of the loop costs as much as a message, so one message per turn would double the work."""
MOST_CHANGES = 32
"""Changes of mind that may wait to be written; of more in one burst the oldest are lost."""


class Telemetry:
    """Takes values from the hot path (`on_...`), gives messages to sinks (`run`).

    sinks: who gets the messages; may be added to and taken from while the car drives.
    journey: scans, score, latency and pose since the start.
    epoch_ns, side, ball_m: as in `TopicWriters`.
    """

    def __init__(
        self,
        observed: Observed,
        car: CarSettings,
        sinks: Sequence[Sink],
        *,
        epoch_ns: int,
        side: Callable[[], Literal["left", "right"]],
        ball_m: Callable[[], Floats | None] = lambda: None,
    ) -> None:
        self.sinks = list(sinks)
        self.journey = snapshot.Journey(observed.clock())
        self._observed = observed
        self._newest = Newest()
        self._writers = TopicWriters(
            observed, car, self._newest, self.journey, epoch_ns=epoch_ns, side=side, ball_m=ball_m
        )
        self._odometry = Odometry(car.wheelbase_m)
        self._news: dict[str, None] = {}  # a set that keeps its order
        self._changes: deque[Output] = deque(maxlen=MOST_CHANGES)
        self._mind: tuple[object, ...] = ()
        self._unanswered_s: float | None = None
        self._woken = asyncio.Event()

    def on_scan(self, scan: Scan) -> None:
        """Note a scan."""
        newest = self._newest
        if newest.scan is not None:
            newest.scan_period_s = scan.stamp_s - newest.scan.stamp_s
        newest.scan = scan
        self._unanswered_s = scan.received_s
        self._note(BY_SCAN)

    def on_guidance(self, scan: Scan, guidance: Guidance) -> None:
        """Note the follower's answer."""
        self._newest.guided = (scan, guidance)
        self.journey.scans += 1
        self.journey.score.add(guidance.error_m)
        self._note(BY_GUIDANCE)

    def on_imu(self, stamp_s: float, turn_radps: Vector, acceleration_mps2: Vector) -> None:
        """Note an inertial measurement in base_link."""
        self._newest.imu = (stamp_s, turn_radps, acceleration_mps2)
        self._note((wire.IMU,))

    def on_output(self, output: Output) -> None:
        """Note a decision, which the motor has already, and let the writing begin."""
        decision = output.decision
        if self._unanswered_s is not None:
            latency_s = self._observed.clock() - self._unanswered_s
            self.journey.latency.add(latency_s)
            if self._observed.timings is not None:
                self._observed.timings.scan_to_motor.add(latency_s)
            self._unanswered_s = None
        state = self._observed.motor.state
        if state is not self._newest.motor:
            self._newest.motor = state
            self.journey.pose = self._odometry.update(state)
            self._note(BY_MOTOR)
        mind = (decision.winner, decision.driver, decision.reason, output.delivered)
        if mind != self._mind:
            self._mind = mind
            self._changes.append(output)
        self._newest.output = output
        self._note(BY_OUTPUT)
        self._woken.set()

    def jobs(self) -> dict[str, Coroutine[Any, Any, Never]]:
        """Return what has to run, by name."""
        return {"telemetry": self.run()}

    async def run(self) -> Never:
        """Write for ever, a few messages per turn of the loop."""
        clock = self._observed.clock
        while True:
            await self._woken.wait()
            self._woken.clear()
            turn_over_s = clock() + TURN_S
            for write in self._due():
                if write() and clock() > turn_over_s:
                    await asyncio.sleep(0)
                    turn_over_s = clock() + TURN_S

    def status(self) -> dict[str, Any]:
        """Return the answer to "why is it (not) moving"."""
        return snapshot.status(self._observed, self._newest.output, self.journey)

    def _note(self, topics: Sequence[str]) -> None:
        for topic in topics:
            self._news[topic] = None

    def _due(self) -> Iterator[Callable[[], bool]]:
        """Yield the writing of everything that was new when it was asked, what hurries first."""
        news, self._news = self._news, {}
        while self._changes:
            yield self._write_change
        hurried = [topic for topic in BY_OUTPUT if topic in news]
        for topic in [*hurried, *(topic for topic in news if topic not in BY_OUTPUT)]:
            yield partial(self._write, topic)

    def _write_change(self) -> bool:
        """Write a change of mind, whatever the rate of `decision` is."""
        output = self._changes.popleft()
        takers = [sink for sink in self.sinks if sink.wants(wire.DECISION, urgent=True)]
        return bool(takers) and self._hand_out(wire.DECISION, self._writers.decision(output), takers)

    def _write(self, topic: str) -> bool:
        """Write one message for whoever wants it; False when it took no time."""
        takers = [sink for sink in self.sinks if sink.wants(topic)]
        if not takers:
            return False
        message = self._writers.write(topic)
        return message is not None and self._hand_out(topic, message, takers)

    def _hand_out(self, topic: str, message: Message, takers: Sequence[Sink]) -> bool:
        stamp_s, payload = message
        stamp_unix_s = self._writers.unix_ns(stamp_s) / NS
        for sink in takers:
            sink.take(topic, TYPES.get(topic, ""), stamp_unix_s, payload)
        return True
