"""Telemetry off the hot path: collects values from the tasks, and writes them once the motor has its command.

The hot path only leaves references. Of most topics the newest value is sent; of topics tied to one scan, every one.
They leave in bursts, one in BURST_PERIOD_S, because each burst wakes every sending thread, and the second message of a
kind costs a quarter of the first; a changed decision does not wait for the next burst. A burst begins when the motor
has its command, and writes for at most TURN_S per turn of the loop, so that other arrivals meanwhile wait hardly
longer. A message that no sink claims is not written at all.
"""

import asyncio
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Literal, Never

from wallride.drivers.api import Scan
from wallride.runtime.arbitration.command import Output
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.localization.gyro_odometry import GyroOdometry
from wallride.runtime.control.localization.localizer import PoseEstimate
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.host.side_work import SideWork
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.ros import messages
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.ros.graph import SCAN_BY_BEAM, TF_ODOM
from wallride.runtime.ros.messages import Floats, Frame
from wallride.runtime.telemetry import course_messages
from wallride.runtime.telemetry import status as car_status
from wallride.runtime.telemetry.sinks import Sink
from wallride.runtime.telemetry.status import ObservedState
from wallride.runtime.telemetry.topic_writers import Message, Newest, TopicWriters, Vector
from wallride.runtime.wire import topics
from wallride.runtime.wire.topics import NewBy

BY_SCAN = (*topics.new_by(NewBy.SCAN), SCAN_BY_BEAM)
BY_GUIDANCE = topics.new_by(NewBy.GUIDANCE)
BY_POSE = topics.new_by(NewBy.POSE)
BY_MOTOR = (*topics.new_by(NewBy.MOTOR), TF_ODOM)
BY_OUTPUT = topics.new_by(NewBy.OUTPUT)
BURST_PERIOD_S = 0.04
"""Period of the bursts. Decisions come every 20 or 25 ms, so that every second one begins a burst: 20 or 25 a
second."""
TURN_S = 0.0002
"""Maximum writing time per turn of the loop. A turn costs as much as a message, so one message per turn would double
the work."""
MAX_WAITING = 32
"""Maximum number of waiting messages of the topics of which every one is sent, such as changed decisions; beyond it in
one burst the oldest are dropped."""

_Waiting = tuple[str, float, Callable[[], Message | None]]
"""Topic, time of the value on the monotonic clock, function that writes the message."""
_Written = tuple[list[Sink], tuple[str, str, float, bytes]]


class Telemetry:
    """Takes values from the hot path (`on_...`), passes messages to sinks (`run`).

    sinks: receive the messages; may be added and removed while the car drives.
    journey: scans, score, latency and pose since the start.
    wall_clock, side, ball_m: as in `TopicWriters`. side_work: keeps the errors of single messages.
    """

    def __init__(
        self,
        observed: ObservedState,
        car: CarSettings,
        sinks: Sequence[Sink],
        *,
        wall_clock: WallClock,
        side: Callable[[], Literal["left", "right"]],
        ball_m: Callable[[], Floats | None] = lambda: None,
    ) -> None:
        self.sinks = list(sinks)
        self.journey = car_status.Journey(observed.clock())
        self._observed = observed
        self.side_work = SideWork(observed.clock)
        self._newest = Newest()
        self._writers = TopicWriters(
            observed, car, self._newest, self.journey, wall_clock=wall_clock, side=side, ball_m=ball_m
        )
        self._odometry = GyroOdometry(car)
        self._news: dict[str, None] = {}  # an ordered set
        self._changes: deque[_Waiting] = deque(maxlen=MAX_WAITING)
        self._each: deque[_Waiting] = deque(maxlen=MAX_WAITING)
        self._mind: tuple[object, ...] = ()
        self._burst_s = -math.inf
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
        state = self._observed.motor.state
        self.journey.score.add(guidance.error_m, state.speed_mps if state is not None else math.nan)
        self._each.append((topics.DISTANCE_ERROR, scan.stamp_s, partial(self._writers.distance_error, scan, guidance)))
        self._note(BY_GUIDANCE)

    def on_imu(self, stamp_s: float, turn_radps: Vector, acceleration_mps2: Vector) -> None:
        """Note an inertial measurement in base_link."""
        self._odometry.take(stamp_s, turn_radps, acceleration_mps2)
        self._each.append((topics.IMU, stamp_s, partial(self._writers.imu, stamp_s, turn_radps, acceleration_mps2)))

    def on_course(self, course: RaceCourse) -> None:
        """Note the map and the line, which hold from here on. Takes its time: to be called before the drive."""
        stamp_s = self._observed.clock()
        told = course_messages.written(course, self._writers.unix_ns(stamp_s))
        self._newest.lasting = {topic: (stamp_s, payload) for topic, payload in told.items()}

    def on_pose(self, estimate: PoseEstimate) -> None:
        """Note the pose on the map at a scan, and where odom lies on the map."""
        self._newest.odom_on_map = self._odom_on_map(estimate)
        if not math.isnan(estimate.slip_s2pm):
            self._odometry.errors.know_scale(estimate.scale)
        self._each.append((topics.POSE, estimate.stamp_s, partial(self._writers.pose, estimate)))
        self._note(BY_POSE)

    def _odom_on_map(self, estimate: PoseEstimate) -> Frame | None:
        """Return odom in map; None while the car is not located. Odometry is carried on to the scan's stamp."""
        motor, odom = self._newest.motor, self.journey.pose
        if motor is None or math.isnan(estimate.x_m):
            return None
        since_s = estimate.stamp_s - motor.stamp_s
        turn_rad = odom.yaw_rate_radps * since_s
        heading_rad, way_m = odom.yaw_rad + 0.5 * turn_rad, odom.speed_mps * since_s
        x_m, y_m = odom.x_m + way_m * math.cos(heading_rad), odom.y_m + way_m * math.sin(heading_rad)
        yaw_rad = math.remainder(estimate.yaw_rad - odom.yaw_rad - turn_rad, math.tau)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        return Frame(
            messages.MAP,
            messages.ODOM,
            estimate.x_m - cos * x_m + sin * y_m,
            estimate.y_m - sin * x_m - cos * y_m,
            yaw_rad,
        )

    def learn(self, scan: Scan) -> None:
        """Learn the odometry's errors from a scan; to be called when it is answered."""
        self._odometry.learn(scan)

    def on_output(self, output: Output) -> None:
        """Note a decision, which the motor has already, and start the writing."""
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
            self.journey.pose, self.journey.heading = self._odometry.update(state), self._odometry.heading
            self._note(BY_MOTOR)
        mind = (decision.winner, decision.driver, decision.reason, output.delivered)
        if mind != self._mind:
            self._mind = mind
            self._changes.append((topics.DECISION, output.stamp_s, partial(self._writers.decision, output)))
        self._each.append((topics.OUTPUT, output.stamp_s, partial(self._writers.output, output)))
        self._newest.output = output
        self._note(BY_OUTPUT)
        if self._changes or output.stamp_s - self._burst_s >= BURST_PERIOD_S:
            self._burst_s = output.stamp_s
            self._woken.set()

    async def run(self) -> Never:
        """Write in a loop, a few messages per turn; the messages of one burst leave together."""
        clock = self._observed.clock
        while True:
            await self._woken.wait()
            self._woken.clear()
            written: list[_Written] = []
            turn_over_s = clock() + TURN_S
            for waiting, urgent in self._due(clock()):
                if self._write(written, *waiting, urgent=urgent) and clock() > turn_over_s:
                    await asyncio.sleep(0)
                    turn_over_s = clock() + TURN_S
            for takers, message in written:
                for sink in takers:
                    try:
                        sink.take(*message)
                    except Exception as error:  # noqa: BLE001 - one sink's mistake is not the others'
                        self.side_work.note(f"sending {message[0]}", error)

    def status(self) -> dict[str, Any]:
        """Return the answer to "why is it (not) moving"."""
        return car_status.status(self._observed, self._newest.output, self.journey)

    def _note(self, names: Sequence[str]) -> None:
        for topic in names:
            self._news[topic] = None

    def _due(self, now_s: float) -> Iterator[tuple[_Waiting, bool]]:
        """Yield every value that was new at the time of the call, urgent ones first, with its urgency."""
        news, self._news = self._news, {}
        for queue, urgent in ((self._changes, True), (self._each, False)):
            while queue:
                yield queue.popleft(), urgent
        hurried = [topic for topic in BY_OUTPUT if topic in news]
        for topic in [*hurried, *(topic for topic in news if topic not in BY_OUTPUT)]:
            yield (topic, now_s, partial(self._newest_of, topic)), False

    def _newest_of(self, topic: str) -> Message | None:
        """Return the newest message on a topic, which may have come during this burst: then it is no news any more."""
        self._news.pop(topic, None)
        return self._writers.write(topic)

    def _write(
        self, written: list[_Written], topic: str, at_s: float, write: Callable[[], Message | None], *, urgent: bool
    ) -> bool:
        """Write one message for the sinks that claim it; False when it took no time."""
        takers = [sink for sink in self.sinks if sink.claim(topic, at_s, urgent=urgent)]
        if not takers:
            return False
        try:
            message = write()
        except Exception as error:  # noqa: BLE001 - one topic's mistake is not the others'
            self.side_work.note(f"writing {topic}", error)
            return True
        if message is None:
            return False
        stamp_s, payload = message
        written.append((takers, (topic, TYPES.get(topic, ""), stamp_s, payload)))
        return True
