"""Parameters of ROS nodes to our settings. Pure: parsed YAML in, settings and remarks out.

Names and units: `vesc_driver`, `vesc_ackermann` (ERPM = gain x m/s + offset; servo position = gain x rad + offset),
`throttle_interpolator`, `urg_node`, `joy_teleop`, and the wall-following lab's `side`, `velocity`, `desired_distance`.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from wallride.runtime.ros.yaml_file import number

SHARED: Final = frozenset({"", "/**", "vesc_driver", "vesc_driver_node"})
"""Nodes whose speed_min and speed_max are in ERPM; others of these names are in m/s."""
HOKUYO: Final = frozenset({"urg_node", "urg_node2", "hokuyo_node"})
LIDARS: Final = ("serial_port", "ip_address")
MAX_REVERSE_MPS: Final = 1.0
"""Our default; a faster reverse is a decision of its own."""
SLASH_WHEELBASE_M: Final = 0.33
SHORT_WHEELBASE_M: Final = 0.26
STOCK_GAIN: Final = 4614.0
TICKS_PER_GAIN: Final = 10.0
"""Metres per tachometer step x speed_to_erpm_gain: six steps per electrical turn."""


@dataclass(frozen=True, slots=True)
class RosParameter:
    """A leaf of the file. node: without its leading slash, "" in a file without nodes. name: with dots."""

    node: str
    name: str
    value: object

    def __str__(self) -> str:
        return f"{self.node}.{self.name}" if self.node else self.name


@dataclass(slots=True)
class Imported:
    """settings: by key, in order. remarks: what to know of a value that was taken. left: parameters, and why not."""

    settings: dict[str, object] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    left: list[tuple[str, str]] = field(default_factory=list)

    def take(self, key: str, value: object, remark: str = "") -> None:
        """Take a setting; a second, different value is remarked."""
        before = self.settings.get(key, value)
        if before != value:
            self.remarks.append(f"{key}: {before} was given before, {value} is taken")
        self.settings[key] = value
        if remark:
            self.remarks.append(f"{key} = {value}: {remark}")

    def leave(self, one: RosParameter, why: str) -> None:
        """Note why a parameter is not taken."""
        self.left.append((str(one), why))


def parameters(tree: Mapping[str, object]) -> Iterator[RosParameter]:
    """Yield the leaves: ROS 2 has them below `ros__parameters` of a node, ROS 1 at the top or below a node."""
    for top, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(_node(top), (), value)
        else:
            yield RosParameter("", str(top), value)


def _node(name: object) -> str:
    text = str(name)
    return text if text == "/**" else text.strip("/").rpartition("/")[2]


def _leaves(node: str, path: tuple[str, ...], tree: Mapping[str, object]) -> Iterator[RosParameter]:
    for key, value in tree.items():
        if key == "ros__parameters" and isinstance(value, Mapping):
            yield from _leaves(_node(path[-1]) if path else node, (), value)
        elif isinstance(value, Mapping):
            yield from _leaves(node, (*path, str(key)), value)
        elif isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            for one in value:
                yield from _leaves(node, (*path, str(one.get("target", key))), one)
        else:
            yield RosParameter(node, ".".join((*path, str(key))), value)


def convert(found: list[RosParameter]) -> Imported:
    """Return the settings of these parameters, and what is to be said of them."""
    imported = Imported()
    gain = next((number for one in found if one.name == "speed_to_erpm_gain" and (number := _number(one.value))), None)
    for one in found:
        rule = RULES.get(one.name.rpartition(".")[2])
        if rule is not None:
            rule(one, imported, gain or STOCK_GAIN)
        else:
            imported.leave(one, _reason(one))
    _lidar(found, imported)
    return imported


Rule = Callable[[RosParameter, Imported, float], None]


def _plain(key: str, remark: Callable[[float], str] = lambda _: "") -> Rule:
    def take(one: RosParameter, imported: Imported, _gain: float) -> None:
        number = _number(one.value)
        if number is None:
            imported.leave(one, f"{one.value!r} is not a number")
        else:
            imported.take(key, number, remark(number))

    return take


def _erpm_gain(one: RosParameter, imported: Imported, _gain: float) -> None:
    number = _number(one.value)
    if not number:
        imported.leave(one, f"{one.value!r} is not a gain")
        return
    remark = ""
    if number < 0:
        remark = (
            "the sign is not taken: positive ERPM is forward here; invert the motor direction in VESC Tool, and prove "
            "it with  wallride doctor --only motor --wheels-up"
        )
    imported.take("motor.speed_to_erpm_gain", abs(number), remark)


def _about_wheelbase(wheelbase_m: float) -> str:
    if wheelbase_m >= SHORT_WHEELBASE_M:
        return ""
    return f"measure it: a car on a Slash chassis has {SLASH_WHEELBASE_M} m, and the stock file is wrong"


def _erpm_limit(one: RosParameter, imported: Imported, gain: float) -> None:
    number = _number(one.value)
    if one.node not in SHARED or number is None:
        imported.leave(one, "a limit of another node; car.max_speed_mps limits every source")
        return
    forward = (number > 0) == (gain > 0)
    speed_mps = round(abs(number / gain), 3)
    if speed_mps == 0:
        imported.leave(one, "0 is no limit to take")
    elif forward:
        imported.take("car.max_speed_mps", speed_mps)
    elif speed_mps > MAX_REVERSE_MPS:
        imported.leave(one, f"{speed_mps:.2f} m/s backward: set car.max_reverse_mps yourself if you want it")
    else:
        imported.take("car.max_reverse_mps", speed_mps)


def _ticks(one: RosParameter, imported: Imported, gain: float) -> None:
    number = _number(one.value)
    by_ticks = TICKS_PER_GAIN / number if number else math.nan
    words = "distance follows from speed_to_erpm_gain"
    if abs(by_ticks - abs(gain)) > 0.01 * abs(gain):
        words += f", which would be {by_ticks:.0f} by this value: calibrate with a tape"
    imported.leave(one, words)


def _side(one: RosParameter, imported: Imported, _gain: float) -> None:
    sides: dict[object, str] = {1: "left", -1: "right", "left": "left", "right": "right"}
    side = sides.get(one.value) if isinstance(one.value, float | str) or type(one.value) is int else None
    if side is None:
        imported.leave(one, f"{one.value!r} is neither 1 (left) nor -1 (right)")
    else:
        imported.take("wall_follow.side", side)


def _scale(one: RosParameter, imported: Imported, _gain: float) -> None:
    number = _number(one.value)
    if not number:
        imported.leave(one, "scale 0 is the pause between two modes")
        return
    option = "--max-steering" if "steering" in one.name else "--max-speed"
    imported.leave(one, f"an option of driving: wallride teleop {option} {abs(number):g}")


RULES: Final[Mapping[str, Rule]] = {
    "speed_to_erpm_gain": _erpm_gain,
    "speed_to_erpm_offset": _plain("motor.speed_to_erpm_offset"),
    "steering_angle_to_servo_gain": _plain("motor.steering_to_servo_gain"),
    "steering_angle_to_servo_offset": _plain("motor.steering_to_servo_offset"),
    "servo_min": _plain("motor.servo_min"),
    "servo_max": _plain("motor.servo_max"),
    "wheelbase": _plain("car.wheelbase_m", _about_wheelbase),
    "speed_min": _erpm_limit,
    "speed_max": _erpm_limit,
    "max_acceleration": _plain("car.max_acceleration_mps2"),
    "max_servo_speed": _plain("car.steering_rate_radps"),
    "max_steering_rate": _plain("car.steering_rate_radps"),
    "tachometer_ticks_to_meters_gain": _ticks,
    "side": _side,
    "velocity": _plain("wall_follow.speed_mps"),
    "desired_distance": _plain("wall_follow.desired_distance_m"),
    "scale": _scale,
}

REASONS: Final = (
    (("kp", "kd", "ki", "kp_angle", "kd_angle", "lookahead_ratio"), "a gain of another law: tune wall_follow.kp, kd"),
    (("port",), "the udev rules name the VESC: serial:///dev/wallride-vesc"),
    (("duty_cycle_min", "duty_cycle_max", "current_min", "current_max", "brake_min", "brake_max", "position_min",
      "position_max"), "a limit inside the VESC: set it in VESC Tool"),
    (("max_deceleration",), "slowing down is never limited"),
    (("deadman_buttons", "axis", "offset"), "the bumpers are the deadman buttons, and pads are known by their USB id"),
    (("device_id", "device_name", "dev", "deadzone", "autorepeat_rate", "coalesce_interval"),
     "pads are known by their USB id; see wallride teleop --help"),
    (("throttle_smoother_rate", "servo_smoother_rate", "output_rate"), "the limiter acts at each command"),
    (("publish_tf", "use_servo_cmd_to_calc_angular_velocity", "odom_frame", "base_frame", "laser_frame_id", "frame_id"),
     "odometry and frames are always published"),
    (("message_value", "type", "interface_type", "message_type", "value"), "there are no ROS messages inside the car"),
)  # fmt: skip
"""Why parameters are not taken, by the last part of their name."""


def _reason(one: RosParameter) -> str:
    last = one.name.rpartition(".")[2]
    if last.endswith(("_topic", "topic_name")):
        return "topics have fixed names: wallride topic list"
    if last in {*LIDARS, "ip_port", "serial_baud", "serial_baudrate"}:
        return (
            "see lidar.address" if one.node in HOKUYO else "of a lidar that wallride does not drive: it drives Hokuyo"
        )
    return next((reason for names, reason in REASONS if last in names), "there is no such setting")


def _lidar(found: list[RosParameter], imported: Imported) -> None:
    """Take the address of a Hokuyo; the network address counts before a serial port, as in its ROS driver."""
    of_it = {one.name: one.value for one in found if one.node in HOKUYO}
    if host := of_it.get("ip_address"):
        imported.take("lidar.address", f"tcp://{host}:{of_it.get('ip_port', 10940)}")
    elif port := of_it.get("serial_port"):
        imported.take(
            "lidar.address", f"serial://{port}?baud={of_it.get('serial_baud', 115200)}",
            "with the udev rules its name is serial:///dev/wallride-lidar",
        )  # fmt: skip
    else:
        return
    imported.left = [(name, why) for name, why in imported.left if why != "see lidar.address"]


def _number(value: object) -> float | None:
    """Return a finite number, also one that is written as text; None for anything else, True is none."""
    found = number(value)
    return found if found is not None and math.isfinite(found) else None
