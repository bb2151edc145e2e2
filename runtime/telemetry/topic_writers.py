"""Writers of the topics' messages from the newest values. Called off the hot path, and only for subscribed topics."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from wallride.drivers.api import LinkState, MotorState, Scan
from wallride.runtime.arbitration.command import NO_WINNER, DriveCommand, Output, Source
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.localization.localizer import PoseEstimate
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.ros import markers, messages
from wallride.runtime.ros.graph import SCAN_BY_BEAM, TF_ODOM
from wallride.runtime.ros.messages import DiagnosticStatus, Floats, Frame
from wallride.runtime.telemetry import marker_writers
from wallride.runtime.telemetry import status as car_status
from wallride.runtime.telemetry.pad import axes_and_buttons
from wallride.runtime.telemetry.status import Journey, ObservedState, SourceStatus
from wallride.runtime.wire import topics

Message = tuple[float, bytes]
"""Time of the measurement on the monotonic clock [s], and the payload."""
Vector = tuple[float, float, float]
LEVELS: Mapping[LinkState, int] = {LinkState.READY: 0, LinkState.STARTING: 1, LinkState.ABSENT: 2, LinkState.FAULTY: 2}


@dataclass(slots=True)
class Newest:
    """One slot for each value of the hot path; a new value replaces the old one."""

    scan: Scan | None = None
    scan_period_s: float = 0.0
    guided: tuple[Scan, Guidance] | None = None
    output: Output | None = None
    motor: MotorState | None = None
    odom_on_map: Frame | None = None
    lasting: Mapping[str, Message] = field(default_factory=dict)


def laser_frame(car: CarSettings) -> Frame:
    """Return the fixed pose of the lidar in base_link."""
    return Frame(messages.BASE, messages.LASER, car.lidar_x_m, car.lidar_y_m, 0.0)


class TopicWriters:
    """Writes a topic on demand.

    wall_clock: for the headers' stamps. side: of the followed wall. ball_m: places of the follower's ball, (2, k),
    base_link, None where it has none.
    """

    def __init__(
        self,
        observed: ObservedState,
        car: CarSettings,
        newest: Newest,
        journey: Journey,
        *,
        wall_clock: WallClock,
        side: Callable[[], Literal["left", "right"]],
        ball_m: Callable[[], Floats | None],
    ) -> None:
        self._observed = observed
        self._car = car
        self._newest = newest
        self._journey = journey
        self.unix_ns = wall_clock.unix_ns
        self._side = side
        self._ball_m = ball_m
        self._laser = laser_frame(car)
        self._writers: Mapping[str, Callable[[], Message | None]] = {
            topics.SCAN: lambda: self._scan(messages.laser_scan),
            SCAN_BY_BEAM: lambda: self._scan(messages.ros_laser_scan),
            topics.WALL: self._wall,
            topics.FOOTPRINT: self._footprint,
            topics.SAFETY: self._safety,
            topics.NAVIGATION: lambda: self._voice(Source.NAVIGATION),
            topics.TELEOP: lambda: self._voice(Source.TELEOP),
            topics.JOY: self._joy,
            topics.ODOM: self._odom,
            topics.TF: self._tf,
            TF_ODOM: self._transforms,
            topics.MOTOR: self._motor,
            topics.BATTERY: self._battery,
            topics.DIAGNOSTICS: self._diagnostics,
            topics.STATUS: self._status,
            topics.DECISION: self._decision,
            topics.MAP: lambda: self._newest.lasting.get(topics.MAP),
            topics.LINE: lambda: self._newest.lasting.get(topics.LINE),
        }

    def write(self, topic: str) -> Message | None:
        """Return the newest message of a topic; None without a value, for example of a silent source."""
        return self._writers[topic]()

    def output(self, output: Output) -> Message:
        """Return `output`: the command sent to the motor."""
        return self._drive(output.stamp_s, output.drive.speed_mps, output.drive.steering_rad)

    def distance_error(self, scan: Scan, guidance: Guidance) -> Message:
        """Return `distance_error` of a scan."""
        return scan.stamp_s, messages.float32(guidance.error_m)

    def imu(self, stamp_s: float, turn_radps: Vector, acceleration_mps2: Vector) -> Message:
        """Return `imu`, in base_link."""
        return stamp_s, messages.imu(self.unix_ns(stamp_s), turn_radps, acceleration_mps2)

    def pose(self, estimate: PoseEstimate) -> Message | None:
        """Return `pose` of a scan; None while the car is not located."""
        if math.isnan(estimate.x_m):
            return None
        stamp_ns = self.unix_ns(estimate.stamp_s)
        place = estimate.x_m, estimate.y_m, estimate.yaw_rad
        return estimate.stamp_s, messages.pose(stamp_ns, *place, estimate.std_m, estimate.std_rad)

    def decision(self, output: Output) -> Message:
        """Return `decision` for a decision that need not be the newest."""
        return output.stamp_s, topics.encode(car_status.decision(self._observed, output))

    def _scan(self, written: Callable[[int, Scan, float], bytes]) -> Message | None:
        scan = self._newest.scan
        if scan is None:
            return None
        return scan.stamp_s, written(self.unix_ns(scan.stamp_s), scan, self._newest.scan_period_s)

    def _wall(self) -> Message | None:
        if self._newest.guided is None:
            return None
        scan, guidance = self._newest.guided
        drawn = marker_writers.wall(guidance, self._side(), self._ball_m())
        return scan.stamp_s, markers.marker_array(self.unix_ns(scan.stamp_s), drawn)

    def _footprint(self) -> Message | None:
        output = self._newest.output
        if output is None:
            return None
        drawn = marker_writers.footprint(output, self._car, self._observed.view())
        return output.stamp_s, markers.marker_array(self.unix_ns(output.stamp_s), drawn)

    def _safety(self) -> Message | None:
        """Return the limit of safety on the present command; None while no source drives or safety is silent."""
        output, queue = self._newest.output, self._observed.queue
        if output is None or output.decision.driver is None:
            return None
        safety, wish = queue.entry(Source.SAFETY), queue.entry(output.decision.driver)
        if safety is None or not isinstance(wish, DriveCommand):
            return None
        heard: SourceStatus = car_status.said(safety, output.decision)
        allowed_mps = math.copysign(min(abs(wish.drive.speed_mps), heard.speed_mps), wish.drive.speed_mps)
        return self._drive(safety.scan_stamp_s or output.stamp_s, allowed_mps, wish.drive.steering_rad)

    def _voice(self, source: Source) -> Message | None:
        """Return a driver's command; None while it is silent."""
        word = self._observed.queue.entry(source)
        if not isinstance(word, DriveCommand):
            return None
        stamp_s = word.scan_stamp_s if word.scan_stamp_s is not None else self._observed.clock()
        return self._drive(stamp_s, word.drive.speed_mps, word.drive.steering_rad)

    def _joy(self) -> Message | None:
        """Return what the operator holds; None without an operator."""
        command, stamp_s = self._observed.held(), self._observed.clock()
        if command is None:
            return None
        return stamp_s, messages.joy(self.unix_ns(stamp_s), *axes_and_buttons(command, self._car))

    def _odom(self) -> Message | None:
        state, pose = self._newest.motor, self._journey.pose
        if state is None:
            return None
        stamp_ns = self.unix_ns(state.stamp_s)
        return state.stamp_s, messages.odometry(
            stamp_ns, pose.x_m, pose.y_m, pose.yaw_rad, pose.speed_mps, pose.yaw_rate_radps
        )

    def _tf(self) -> Message | None:
        """Return base_link in odom together with the fixed laser in base_link: a late subscriber gets both at once."""
        return self._transforms(self._laser)

    def _transforms(self, *fixed: Frame) -> Message | None:
        """Return base_link in odom, odom in map while it is known, and the fixed frames."""
        state, pose = self._newest.motor, self._journey.pose
        if state is None:
            return None
        base = Frame(messages.ODOM, messages.BASE, pose.x_m, pose.y_m, pose.yaw_rad)
        above = () if self._newest.odom_on_map is None else (self._newest.odom_on_map,)
        return state.stamp_s, messages.transforms(self.unix_ns(state.stamp_s), (*above, base, *fixed))

    def _motor(self) -> Message | None:
        state = self._newest.motor
        return (state.stamp_s, messages.motor(self.unix_ns(state.stamp_s), state)) if state is not None else None

    def _battery(self) -> Message | None:
        state = self._newest.motor
        if state is None:
            return None
        return state.stamp_s, messages.battery(self.unix_ns(state.stamp_s), state.voltage_v, state.input_current_a)

    def _diagnostics(self) -> Message | None:
        observed, stamp_s = self._observed, self._observed.clock()
        reports = []
        for name, device in (("lidar", observed.lidar), ("motor", observed.motor)):
            health = device.health
            counts = {what: str(times) for what, times in health.counts.items()}
            reports.append(DiagnosticStatus(LEVELS[health.link], name, health.message, health.identity, counts))
        window = tuple(observed.window())
        reports.append(DiagnosticStatus(1 if window else 0, "window", "; ".join(window) or "clean", "", {}))
        if (output := self._newest.output) is not None:
            decision = output.decision
            why = f"{decision.winner or NO_WINNER}: {decision.reason}"
            seconds = {winner: f"{spent_s:.1f} s" for winner, spent_s in observed.seconds_by_winner.items()}
            reports.append(DiagnosticStatus(0 if output.delivered else 2, "mux", why, "", seconds))
        return stamp_s, messages.diagnostics(self.unix_ns(stamp_s), reports)

    def _status(self) -> Message | None:
        status = car_status.status(self._observed, self._newest.output, self._journey)
        return status["stamp_s"], topics.encode(status)

    def _decision(self) -> Message | None:
        return self.decision(self._newest.output) if self._newest.output is not None else None

    def _drive(self, stamp_s: float, speed_mps: float, steering_rad: float) -> Message:
        return stamp_s, messages.ackermann(self.unix_ns(stamp_s), speed_mps, steering_rad)
