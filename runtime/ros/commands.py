"""Readers of ROS 2 messages that reach the car. Bytes from outside: every length is checked before it is used."""

import struct

from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.cdr import ENCAPSULATION
from wallride.runtime.wire.teleop import MAX_SPEED_MPS, MAX_STEERING_RAD, Malformed

_STAMP_AND_LENGTH = struct.Struct("<iII")
_DRIVE = struct.Struct("<fffff")


def read_ackermann(payload: bytes) -> tuple[float, float, float | None]:
    """Return speed [m/s], steering angle [rad] and stamp [s] of an AckermannDriveStamped; Malformed otherwise.

    The stamp is that of its header, None for 0: not given.
    """
    if not payload.startswith(ENCAPSULATION):
        raise Malformed("not CDR, little endian")
    body = payload[len(ENCAPSULATION) :]
    if len(body) < _STAMP_AND_LENGTH.size:
        raise Malformed(f"{len(payload)} bytes are too few")
    stamp_s, stamp_ns, name_bytes = _STAMP_AND_LENGTH.unpack_from(body)
    at = _STAMP_AND_LENGTH.size + name_bytes
    at += -at % 4
    if at + _DRIVE.size != len(body):
        raise Malformed(f"{len(payload)} bytes do not fit its parts")
    steering_rad, _, speed_mps, _, _ = _DRIVE.unpack_from(body, at)
    if not (abs(speed_mps) <= MAX_SPEED_MPS and abs(steering_rad) <= MAX_STEERING_RAD):  # false for NaN
        raise Malformed("a speed or a steering angle that is no number or impossible")
    return speed_mps, steering_rad, stamp_s + stamp_ns / NS if stamp_s or stamp_ns else None
