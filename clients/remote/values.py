"""Messages as dataclasses of SI values and numpy arrays: what the iterators of a car and of a recording yield.

stamp_s: seconds since 1970; of the measurement, where the message has a header, else of the arrival or the recording.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from wallride.clients.decoding import UnreadableError, decode, message_of
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics

Floats = npt.NDArray[np.float32] | npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ScanSample:
    """`scan`, frame laser. ranges_m: (n,), NaN without a return; beam i is at angle_min_rad + i * angle_step_rad.

    stamp_s: end of the sweep. scan_time_s: of a revolution. ray_s: time from one beam to the next, negative where they
    run against the sensor's turn, 0 where all are as seen at stamp_s.
    """

    stamp_s: float
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float
    ranges_m: Floats
    scan_time_s: float = 0.0
    ray_s: float = 0.0

    @property
    def angles_rad(self) -> Floats:
        """Return the bearing of each beam, (n,), positive to the left."""
        return self.angle_min_rad + self.angle_step_rad * np.arange(self.ranges_m.size)

    @property
    def points_m(self) -> Floats:
        """Return x, y of each return in frame laser, (2, n); NaN without one."""
        angles_rad = self.angles_rad
        return np.array([self.ranges_m * np.cos(angles_rad), self.ranges_m * np.sin(angles_rad)])


@dataclass(frozen=True, slots=True)
class OdometrySample:
    """`odom`: pose of base_link in odom, and its speeds."""

    stamp_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    yaw_rate_radps: float


@dataclass(frozen=True, slots=True)
class PoseSample:
    """`pose`, frame map: the rear axle on the map, and its standard deviations; absent while it is not located."""

    stamp_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    std_m: float
    std_rad: float


@dataclass(frozen=True, slots=True)
class DriveSample:
    """`navigation`, `teleop`, `safety`, `output`: a speed and a steering angle."""

    stamp_s: float
    speed_mps: float
    steering_rad: float


@dataclass(frozen=True, slots=True)
class MotorSample:
    """`motor`: distance, speed and current of the motor, and the commanded steering angle."""

    stamp_s: float
    distance_m: float
    speed_mps: float
    current_a: float
    steering_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class ImuSample:
    """`imu`, frame base_link: angular rates and accelerations, (3,) each."""

    stamp_s: float
    turn_radps: Floats
    acceleration_mps2: Floats


@dataclass(frozen=True, slots=True)
class BatterySample:
    """`battery`; current_a: discharge current, positive."""

    stamp_s: float
    voltage_v: float
    current_a: float


@dataclass(frozen=True, slots=True)
class NumberSample:
    """`distance_error` [m], NaN without a wall."""

    stamp_s: float
    value: float


@dataclass(frozen=True, slots=True)
class TransformSample:
    """Pose of a frame in its parent, in the plane."""

    stamp_s: float
    parent: str
    child: str
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class MarkerSample:
    """A line or points in base_link. points_m: (2, n)."""

    stamp_s: float
    name: str
    points_m: Floats


@dataclass(frozen=True, slots=True)
class TransformsSample:
    """`tf`."""

    stamp_s: float
    transforms: tuple[TransformSample, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MarkersSample:
    """`wall` and `footprint`."""

    stamp_s: float
    markers: tuple[MarkerSample, ...]


@dataclass(frozen=True, slots=True)
class FieldsSample:
    """`status`, `decision`, `diagnostics`, `beat`: named values, as `wallride topic echo` shows them."""

    stamp_s: float
    fields: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - whatever the message holds
        return self.fields[name]


Value = (
    ScanSample
    | OdometrySample
    | PoseSample
    | DriveSample
    | MotorSample
    | ImuSample
    | BatterySample
    | NumberSample
    | TransformsSample
    | MarkersSample
    | FieldsSample
)


def value_of(topic: str, payload: bytes, taken_s: float) -> Value:
    """Return a message as a value; UnreadableError for a payload that does not fit its topic.

    taken_s: seconds since 1970 of its arrival or its recording.
    """
    schema = TYPES.get(topic, "")
    read = _READERS.get(schema)
    if read is None:
        return FieldsSample(taken_s, decode(topic, payload))
    try:
        return read(message_of(topic, schema, payload), taken_s)
    except (IndexError, ValueError) as error:
        raise UnreadableError(f"{topic}: {len(payload)} bytes with other contents than a car's ({error})") from None


def _scan(message: Any, _taken_s: float) -> ScanSample:  # noqa: ANN401 - rosbags' own classes, here and below
    return ScanSample(
        _stamp_s(message), message.angle_min, message.angle_increment, message.range_min, message.range_max,
        message.ranges, message.scan_time, message.time_increment,
    )  # fmt: skip


def _odometry(message: Any, _taken_s: float) -> OdometrySample:  # noqa: ANN401
    pose, twist = message.pose.pose, message.twist.twist
    return OdometrySample(
        _stamp_s(message), pose.position.x, pose.position.y, _yaw_rad(pose.orientation), twist.linear.x, twist.angular.z
    )


def _pose(message: Any, _taken_s: float) -> PoseSample:  # noqa: ANN401
    place, covariance = message.pose.pose, message.pose.covariance
    deviations = math.sqrt(covariance[0]), math.sqrt(covariance[35])
    return PoseSample(_stamp_s(message), place.position.x, place.position.y, _yaw_rad(place.orientation), *deviations)


def _drive(message: Any, _taken_s: float) -> DriveSample:  # noqa: ANN401
    return DriveSample(_stamp_s(message), message.drive.speed, message.drive.steering_angle)


def _motor(message: Any, _taken_s: float) -> MotorSample:  # noqa: ANN401
    (distance_m, steering_rad), speed_mps, current_a = message.position, message.velocity[0], message.effort[0]
    return MotorSample(_stamp_s(message), float(distance_m), float(speed_mps), float(current_a), float(steering_rad))


def _imu(message: Any, _taken_s: float) -> ImuSample:  # noqa: ANN401
    return ImuSample(_stamp_s(message), _vector(message.angular_velocity), _vector(message.linear_acceleration))


def _battery(message: Any, _taken_s: float) -> BatterySample:  # noqa: ANN401
    return BatterySample(_stamp_s(message), message.voltage, -message.current)


def _number(message: Any, taken_s: float) -> NumberSample:  # noqa: ANN401
    return NumberSample(taken_s, message.data)


def _transforms(message: Any, taken_s: float) -> TransformsSample:  # noqa: ANN401
    frames = tuple(
        TransformSample(
            _stamp_s(one), one.header.frame_id, one.child_frame_id, one.transform.translation.x,
            one.transform.translation.y, _yaw_rad(one.transform.rotation),
        )
        for one in message.transforms
    )  # fmt: skip
    return TransformsSample(frames[0].stamp_s if frames else taken_s, frames)


def _markers(message: Any, taken_s: float) -> MarkersSample:  # noqa: ANN401
    drawn = tuple(
        MarkerSample(_stamp_s(one), one.ns, np.array([(point.x, point.y) for point in one.points]).reshape(-1, 2).T)
        for one in message.markers
    )
    return MarkersSample(drawn[0].stamp_s if drawn else taken_s, drawn)


def _stamp_s(message: Any) -> float:  # noqa: ANN401
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec / NS)


def _yaw_rad(rotation: Any) -> float:  # noqa: ANN401
    return 2 * math.atan2(rotation.z, rotation.w)


def _vector(vector: Any) -> Floats:  # noqa: ANN401
    return np.array([vector.x, vector.y, vector.z])


_READERS: Final[Mapping[str, Callable[[Any, float], Value]]] = {
    TYPES[topics.SCAN]: _scan,
    TYPES[topics.ODOM]: _odometry,
    TYPES[topics.POSE]: _pose,
    TYPES[topics.OUTPUT]: _drive,
    TYPES[topics.MOTOR]: _motor,
    TYPES[topics.IMU]: _imu,
    TYPES[topics.BATTERY]: _battery,
    TYPES[topics.DISTANCE_ERROR]: _number,
    TYPES[topics.TF]: _transforms,
    TYPES[topics.WALL]: _markers,
}
