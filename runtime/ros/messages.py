"""Every message that the car publishes, one function each: SI values in, CDR bytes out.

stamp_ns: nanoseconds since 1970, of the measurement. Frames (REP-105): `laser` for the scan, `base_link` (middle of the
rear axle), `odom`. The order of the writes is that of the fields in types.msg.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.api import MotorState, Scan
from runtime.ros.cdr import CdrWriter

BASE, LASER, ODOM = "base_link", "laser", "odom"
NS = 1_000_000_000

Floats = npt.NDArray[np.float64]

NOTHING: Floats = np.empty(0)
NAN = math.nan
UNKNOWN_3X3: Floats = np.zeros(9)
NO_ORIENTATION_3X3: Floats = np.array([-1.0, *np.zeros(8)])
"""What sensor_msgs/Imu says where there is no estimate."""
WHEEL_COVARIANCE_6X6: Floats = np.diag([0.05, 0.05, 1e6, 1e6, 1e6, 0.1]).ravel()
"""Dead reckoning in a plane: a rough guess for x, y and yaw, nothing known of the rest."""


@dataclass(frozen=True, slots=True)
class Report:
    """One line of diagnostics: level 0 ok, 1 warning, 2 error, 3 stale."""

    level: int
    name: str
    message: str
    hardware: str
    values: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Frame:
    """Where a frame stands in its parent, in the plane."""

    parent: str
    child: str
    x_m: float
    y_m: float
    yaw_rad: float


def laser_scan(stamp_ns: int, scan: Scan, scan_time_s: float) -> bytes:
    """Return sensor_msgs/LaserScan; NaN where a beam has no distance, no intensities.

    All beams carry the time of the sweep's last byte (time_increment 0): what came when is the sensor's secret.
    """
    out = _stamped(stamp_ns, LASER)
    beams = scan.ranges_m.shape[0]
    out.put("fff", scan.angle_min_rad, scan.angle_min_rad + scan.angle_step_rad * (beams - 1), scan.angle_step_rad)
    out.put("ffff", 0.0, scan_time_s, scan.range_min_m, scan.range_max_m)
    out.sequence("f", scan.ranges_m)
    out.sequence("f", NOTHING)
    return out.done()


def odometry(stamp_ns: int, x_m: float, y_m: float, yaw_rad: float, speed_mps: float, yaw_rate_radps: float) -> bytes:
    """Return nav_msgs/Odometry: base_link in odom, speeds in base_link."""
    out = _stamped(stamp_ns, ODOM)
    out.text(BASE)
    out.put("ddddddd", x_m, y_m, 0.0, *_quaternion(yaw_rad))
    out.array("d", WHEEL_COVARIANCE_6X6)
    out.put("dddddd", speed_mps, 0.0, 0.0, 0.0, 0.0, yaw_rate_radps)
    out.array("d", WHEEL_COVARIANCE_6X6)
    return out.done()


def ackermann(stamp_ns: int, speed_mps: float, steering_rad: float) -> bytes:
    """Return ackermann_msgs/AckermannDriveStamped in base_link; rates and accelerations are 0: unspecified."""
    out = _stamped(stamp_ns, BASE)
    out.put("fffff", steering_rad, 0.0, speed_mps, 0.0, 0.0)
    return out.done()


def float32(value: float) -> bytes:
    """Return std_msgs/Float32."""
    out = CdrWriter()
    out.put("f", value)
    return out.done()


def imu(stamp_ns: int, turn_radps: tuple[float, float, float], acceleration_mps2: tuple[float, float, float]) -> bytes:
    """Return sensor_msgs/Imu in base_link, without an orientation."""
    out = _stamped(stamp_ns, BASE)
    out.put("dddd", 0.0, 0.0, 0.0, 1.0)
    out.array("d", NO_ORIENTATION_3X3)
    out.put("ddd", *turn_radps)
    out.array("d", UNKNOWN_3X3)
    out.put("ddd", *acceleration_mps2)
    out.array("d", UNKNOWN_3X3)
    return out.done()


def motor(stamp_ns: int, state: MotorState) -> bytes:
    """Return sensor_msgs/JointState of two joints: `drive` in metres, m/s and motor amperes, `steering` in radians.

    The steering is the angle commanded: hobby servos have no read-back. What else the controller says is in `battery`
    and `diagnostics`.
    """
    out = _stamped(stamp_ns, BASE)
    out.texts(("drive", "steering"))
    out.sequence("d", np.array([state.distance_m, state.steering_rad]))
    out.sequence("d", np.array([state.speed_mps, NAN]))
    out.sequence("d", np.array([state.motor_current_a, NAN]))
    return out.done()


def battery(stamp_ns: int, voltage_v: float, current_a: float) -> bytes:
    """Return sensor_msgs/BatteryState; current_a is what the battery gives, which the message wants negative."""
    out = _stamped(stamp_ns, BASE)
    out.put("fffffff", voltage_v, NAN, -current_a, NAN, NAN, NAN, NAN)
    discharging, lithium_polymer = 2, 3
    out.put("BBB?", discharging, 0, lithium_polymer, True)  # noqa: FBT003 - present
    out.sequence("f", NOTHING)
    out.sequence("f", NOTHING)
    out.text("")
    out.text("")
    return out.done()


def diagnostics(stamp_ns: int, reports: Sequence[Report]) -> bytes:
    """Return diagnostic_msgs/DiagnosticArray."""
    out = _stamped(stamp_ns, "")
    out.put("I", len(reports))
    for report in reports:
        out.put("B", report.level)
        out.text(report.name)
        out.text(report.message)
        out.text(report.hardware)
        out.put("I", len(report.values))
        for key, value in report.values.items():
            out.text(key)
            out.text(value)
    return out.done()


def transforms(stamp_ns: int, frames: Sequence[Frame]) -> bytes:
    """Return tf2_msgs/TFMessage."""
    out = CdrWriter()
    out.put("I", len(frames))
    for frame in frames:
        header(out, stamp_ns, frame.parent)
        out.text(frame.child)
        out.put("ddddddd", frame.x_m, frame.y_m, 0.0, *_quaternion(frame.yaw_rad))
    return out.done()


def header(out: CdrWriter, stamp_ns: int, frame: str) -> None:
    """Add a std_msgs/Header."""
    out.put("iI", *divmod(stamp_ns, NS))
    out.text(frame)


def _stamped(stamp_ns: int, frame: str) -> CdrWriter:
    out = CdrWriter()
    header(out, stamp_ns, frame)
    return out


def _quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)
