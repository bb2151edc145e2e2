"""Every message that the car publishes, one function each: SI values in, CDR bytes out.

stamp_ns: nanoseconds since 1970, of the measurement. Frames (REP-105): `laser` for the scan, `base_link` (middle of the
    rear axle), `odom`. The order of the writes is that of the fields in types.msg.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import MotorState, Scan
from wallride.drivers.value import value
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.cdr import CdrWriter, Template

BASE, LASER, ODOM, MAP = "base_link", "laser", "odom", "map"
MAX_SECONDS = 2**31 - 1

Floats = npt.NDArray[np.float64]

NOTHING: Floats = np.empty(0)
NO_NUMBERS = b"\0\0\0\0"
"""An empty sequence, where the numbers before it end at a multiple of four."""
NAN = math.nan
UNKNOWN_3X3: Floats = np.zeros(9)
NO_ORIENTATION_3X3: Floats = np.array([-1.0, *np.zeros(8)])
"""Covariance of sensor_msgs/Imu where there is no estimate of the orientation."""
WHEEL_COVARIANCE_6X6: Floats = np.diag([0.05, 0.05, 1e6, 1e6, 1e6, 0.1]).ravel()
"""Covariance of dead reckoning in a plane: a rough guess for x, y and yaw, unknown for the rest."""


@value()
class DiagnosticStatus:
    """One line of diagnostics: level 0 ok, 1 warning, 2 error, 3 stale."""

    level: int
    name: str
    message: str
    hardware: str
    values: Mapping[str, str]


@value()
class Frame:
    """Pose of a frame in its parent, in the plane."""

    parent: str
    child: str
    x_m: float
    y_m: float
    yaw_rad: float


def split_time(stamp_ns: int) -> tuple[int, int]:
    """Return the fields of builtin_interfaces/Time; after its 32 bits end (2038-01-19), their last value."""
    seconds, nanoseconds = divmod(stamp_ns, NS)
    return (seconds, nanoseconds) if -MAX_SECONDS <= seconds <= MAX_SECONDS else (MAX_SECONDS, NS - 1)


def laser_scan(stamp_ns: int, scan: Scan, scan_time_s: float) -> bytes:
    """Return sensor_msgs/LaserScan; NaN where a beam has no distance, no intensities.

    The stamp is the time of the sweep's last byte, by which the laws and the replay count, and time_increment the
    scan's `ray_s`.
    """
    return _laser_scan(stamp_ns, scan, scan.ranges_m, scan_time_s)


def ros_laser_scan(stamp_ns: int, scan: Scan, scan_time_s: float) -> bytes:
    """Return sensor_msgs/LaserScan as programs of ROS read it: REP 117, and the time of each beam.

    The stamp is that of the first beam in the array, counted back from the sweep's last byte, and time_increment the
    time to the next, negative for a sensor that is mounted upside down. A beam from which nothing came back is +inf, by
    which maps are cleared, one that is too near -inf; a fault of the measurement is NaN.
    """
    first_ns = stamp_ns - round((scan.ranges_m.shape[0] - 1) * max(scan.ray_s, 0.0) * NS)
    ranges_m = scan.ranges_m if scan.returns is None else scan.returns.marked_m()
    return _laser_scan(first_ns, scan, ranges_m, scan_time_s)


def _laser_scan(stamp_ns: int, scan: Scan, ranges_m: npt.NDArray[np.float32], scan_time_s: float) -> bytes:
    beams = scan.ranges_m.shape[0]
    last_rad = scan.angle_min_rad + scan.angle_step_rad * (beams - 1)
    head = _SCAN.fill(
        *split_time(stamp_ns), scan.angle_min_rad, last_rad, scan.angle_step_rad,
        scan.ray_s, scan_time_s, scan.range_min_m, scan.range_max_m, beams,
    )  # fmt: skip
    return head + np.ascontiguousarray(ranges_m, "<f4").tobytes() + NO_NUMBERS


def odometry(stamp_ns: int, x_m: float, y_m: float, yaw_rad: float, speed_mps: float, yaw_rate_radps: float) -> bytes:
    """Return nav_msgs/Odometry: base_link in odom, speeds in base_link."""
    place = x_m, y_m, 0.0, *_quaternion(yaw_rad)
    return _ODOMETRY.fill(*split_time(stamp_ns), *place, speed_mps, yaw_rate_radps)


def pose(stamp_ns: int, x_m: float, y_m: float, yaw_rad: float, std_m: float, std_rad: float) -> bytes:
    """Return geometry_msgs/PoseWithCovarianceStamped: base_link in map.

    std_m: standard deviation in the worst direction, told of both; std_rad: of the heading.
    """
    covariance = [0.0] * 36
    covariance[0] = covariance[7] = std_m**2
    covariance[35] = std_rad**2
    return _POSE.fill(*split_time(stamp_ns), x_m, y_m, 0.0, *_quaternion(yaw_rad), *covariance)


def occupancy_grid(
    stamp_ns: int, values: npt.NDArray[np.int8], cell_m: float, corner: tuple[float, float, float]
) -> bytes:
    """Return nav_msgs/OccupancyGrid. values: (rows, columns), row 0 lowest in y: 0 free, 100 occupied, -1 unknown.

    corner: x [m], y [m], yaw [rad] of the corner of cell (0, 0) in map.
    """
    out = _stamped(stamp_ns, MAP)
    x_m, y_m, yaw_rad = corner
    rows, columns = values.shape
    out.put("iIfII", *split_time(stamp_ns), cell_m, columns, rows)
    out.put("ddddddd", x_m, y_m, 0.0, *_quaternion(yaw_rad))
    out.sequence("B", values.view(np.uint8))
    return out.done()


def path(stamp_ns: int, poses: Sequence[tuple[float, float, float, float]]) -> bytes:
    """Return nav_msgs/Path in map. poses: time after the stamp [s], x [m], y [m], yaw [rad]."""
    out = _stamped(stamp_ns, MAP)
    out.put("I", len(poses))
    for after_s, x_m, y_m, yaw_rad in poses:
        header(out, stamp_ns + round(after_s * NS), MAP)
        out.put("ddddddd", x_m, y_m, 0.0, *_quaternion(yaw_rad))
    return out.done()


def ackermann(stamp_ns: int, speed_mps: float, steering_rad: float) -> bytes:
    """Return ackermann_msgs/AckermannDriveStamped in base_link; rates and accelerations are 0: unspecified."""
    return _ACKERMANN.fill(*split_time(stamp_ns), steering_rad, 0.0, speed_mps, 0.0, 0.0)


def float32(value: float) -> bytes:
    """Return std_msgs/Float32."""
    return _FLOAT32.fill(value)


def imu(stamp_ns: int, turn_radps: tuple[float, float, float], acceleration_mps2: tuple[float, float, float]) -> bytes:
    """Return sensor_msgs/Imu in base_link, without an orientation."""
    return _IMU.fill(*split_time(stamp_ns), *turn_radps, *acceleration_mps2)


def motor(stamp_ns: int, state: MotorState) -> bytes:
    """Return sensor_msgs/JointState of two joints: `drive` in metres, m/s and motor amperes, `steering` in radians.

    The steering is the angle commanded: hobby servos have no read-back. The controller's other values are in `battery`
    and `diagnostics`.
    """
    return _MOTOR.fill(
        *split_time(stamp_ns), state.distance_m, state.steering_rad, state.speed_mps, state.motor_current_a
    )


def battery(stamp_ns: int, voltage_v: float, current_a: float) -> bytes:
    """Return sensor_msgs/BatteryState; current_a: discharge current, positive; negative in the message."""
    out = _stamped(stamp_ns, BASE)
    out.put("fffffff", voltage_v, NAN, -current_a, NAN, NAN, NAN, NAN)
    discharging, lithium_polymer = 2, 3
    out.put("BBB?", discharging, 0, lithium_polymer, True)  # noqa: FBT003 - present
    out.sequence("f", NOTHING)
    out.sequence("f", NOTHING)
    out.text("")
    out.text("")
    return out.done()


def joy(stamp_ns: int, axes: Sequence[float], buttons: Sequence[int]) -> bytes:
    """Return sensor_msgs/Joy."""
    out = _stamped(stamp_ns, "joy")
    out.put("I", len(axes))
    out.put("f" * len(axes), *axes)
    out.put("I", len(buttons))
    out.put("i" * len(buttons), *buttons)
    return out.done()


def diagnostics(stamp_ns: int, reports: Sequence[DiagnosticStatus]) -> bytes:
    """Return diagnostic_msgs/DiagnosticArray."""
    out = _stamped(stamp_ns, "")
    out.put("I", len(reports))
    for report in reports:
        out.put("B", report.level)
        out.text(report.name)
        out.text(report.message)
        out.text(report.hardware)
        out.put("I", len(report.values))
        for key, text in report.values.items():
            out.text(key)
            out.text(text)
    return out.done()


def transforms(stamp_ns: int, frames: Sequence[Frame]) -> bytes:
    """Return tf2_msgs/TFMessage."""
    seconds, nanoseconds = split_time(stamp_ns)
    names: list[str] = []
    numbers: list[float] = []
    for frame in frames:
        names += frame.parent, frame.child
        numbers += seconds, nanoseconds, frame.x_m, frame.y_m, 0.0, *_quaternion(frame.yaw_rad)
    return _transforms(*names).fill(*numbers)


def header(out: CdrWriter, stamp_ns: int, frame: str) -> None:
    """Add a std_msgs/Header."""
    out.put("iI", *split_time(stamp_ns))
    out.text(frame)


def _stamped(stamp_ns: int, frame: str) -> CdrWriter:
    out = CdrWriter()
    header(out, stamp_ns, frame)
    return out


def _quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)


def _template(frame: str, holes: str = "") -> Template:
    """Return a message that begins with a header of this frame, and goes on with numbers of these kinds."""
    out = Template()
    out.holes("iI")
    out.text(frame)
    out.holes(holes)
    return out


def _odometry() -> Template:
    out = _template(ODOM)
    out.text(BASE)
    out.holes("ddddddd")
    out.array("d", WHEEL_COVARIANCE_6X6)
    out.holes("d")
    out.put("dddd", 0.0, 0.0, 0.0, 0.0)
    out.holes("d")
    out.array("d", WHEEL_COVARIANCE_6X6)
    return out


def _float32() -> Template:
    out = Template()
    out.holes("f")
    return out


def _imu() -> Template:
    out = _template(BASE)
    out.put("dddd", 0.0, 0.0, 0.0, 1.0)
    out.array("d", NO_ORIENTATION_3X3)
    out.holes("ddd")
    out.array("d", UNKNOWN_3X3)
    out.holes("ddd")
    out.array("d", UNKNOWN_3X3)
    return out


def _motor() -> Template:
    out = _template(BASE)
    out.texts(("drive", "steering"))
    out.put("I", 2)
    out.holes("dd")
    for _ in ("velocity", "effort"):
        out.put("I", 2)
        out.holes("d")
        out.put("d", NAN)
    return out


@lru_cache(maxsize=16)
def _transforms(*names: str) -> Template:
    out = Template()
    out.put("I", len(names) // 2)
    for parent, child in zip(names[::2], names[1::2], strict=True):
        out.holes("iI")
        out.text(parent)
        out.text(child)
        out.holes("ddddddd")
    return out


_SCAN, _POSE, _ACKERMANN = _template(LASER, "fffffffI"), _template(MAP, "d" * (7 + 36)), _template(BASE, "fffff")
_ODOMETRY, _FLOAT32, _IMU, _MOTOR = _odometry(), _float32(), _imu(), _motor()
