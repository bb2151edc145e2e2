"""Reader of sensor_msgs/LaserScan from outside. Every length is checked before it is used."""

import math
import struct
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.scan_check import MAX_BEAMS
from wallride.drivers.value import value
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.cdr import ENCAPSULATION
from wallride.runtime.wire.ingress import MAX_INCOMING_B
from wallride.runtime.wire.teleop import Malformed

MAX_FRAME_B: Final = 256
_HEADER = struct.Struct("<4xiII")
"""After the encapsulation: the stamp, and the length of the frame's name."""
_GEOMETRY = struct.Struct("<fffffffI")
_COUNT = struct.Struct("<I")
_FLOAT: Final = np.dtype("<f4")
_NOTHING: Final = np.float32(np.nan)


@value(eq=False)
class LaserScan:
    """One scan, its beams in counter-clockwise order (REP-103).

    stamp_ns: nanoseconds since 1970 at which the last beam was measured. ray_s: time from one beam of the array to the
        next, negative where the array runs against the sensor's turn.
    ranges_m: (n,) float32, read-only; NaN where the message has NaN, an infinity, or a range outside of the sensor's.
    """

    stamp_ns: int
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float
    ray_s: float
    ranges_m: npt.NDArray[np.float32]


def read_laser_scan(payload: bytes) -> LaserScan:
    """Return the scan in a message in CDR, little endian; Malformed says what is wrong with it."""
    if len(payload) > MAX_INCOMING_B:
        raise Malformed(f"{len(payload)} bytes are too many")
    if not payload.startswith(ENCAPSULATION):
        raise Malformed("not CDR, little endian")
    if len(payload) < _HEADER.size:
        raise Malformed(f"{len(payload)} bytes are too few")
    seconds, nanoseconds, name_bytes = _HEADER.unpack_from(payload)
    at = _HEADER.size + name_bytes
    at += -at % 4
    if name_bytes > MAX_FRAME_B or at + _GEOMETRY.size > len(payload):
        raise Malformed(f"{len(payload)} bytes do not fit its parts")
    first_rad, last_rad, step_rad, ray_s, _, near_m, far_m, beams = _GEOMETRY.unpack_from(payload, at)
    at += _GEOMETRY.size
    _check_length(payload, at, beams)
    _check_geometry(first_rad, last_rad, step_rad, beams)
    if not (math.isfinite(ray_s) and 0 <= near_m < far_m < math.inf):
        raise Malformed(f"ranges from {near_m:g} to {far_m:g} m and {ray_s:g} s a beam are none of a lidar")
    if not (seconds or nanoseconds):
        raise Malformed("the header has no stamp")
    ranges_m = usable_ranges(payload, at, beams, near_m, far_m, int(step_rad < 0))
    last_ns = seconds * NS + nanoseconds + round((beams - 1) * max(ray_s, 0.0) * NS)
    if step_rad < 0:
        first_rad, step_rad, ray_s = first_rad + (beams - 1) * step_rad, -step_rad, -ray_s
    return LaserScan(last_ns, first_rad, step_rad, near_m, far_m, ray_s, ranges_m)


def _check_length(payload: bytes, begin: int, beams: int) -> None:
    """Refuse a message that ranges from the byte `begin` on, and the intensities, do not fill."""
    if not 2 <= beams <= MAX_BEAMS:
        raise Malformed(f"a scan of {beams} beams")
    end = begin + 4 * beams
    if end + _COUNT.size > len(payload):
        raise Malformed(f"{beams} beams do not fit into the message")
    (intensities,) = _COUNT.unpack_from(payload, end)
    if intensities not in {0, beams} or end + _COUNT.size + 4 * intensities != len(payload):
        raise Malformed(f"{beams} beams and {intensities} intensities do not fit the message")


@accelerated
def usable_ranges(
    payload: bytes, begin: int, beams: int, near_m: float, far_m: float, reverse: int
) -> npt.NDArray[np.float32]:
    """Return the ranges from the byte `begin` on, (beams,), read-only, NaN outside of the limits; 1: in reverse order.

    The limits are numbers of 32 bits, as the message has them. ValueError where it has not so many.
    """
    sent_m = np.frombuffer(payload, _FLOAT, beams, begin)
    usable = (sent_m >= near_m) & (sent_m <= far_m) & (sent_m > 0.0)
    ranges_m = np.where(usable, sent_m, _NOTHING)
    ranges_m = np.ascontiguousarray(ranges_m[::-1] if reverse else ranges_m)
    ranges_m.setflags(write=False)
    return ranges_m


def _check_geometry(first_rad: float, last_rad: float, step_rad: float, beams: int) -> None:
    """Refuse a field that its step and number of beams contradict.

    Drivers disagree on whether angle_max is the last beam or one step after it; either is taken, the beams count.
    """
    if not (math.isfinite(first_rad + last_rad + step_rad) and step_rad):
        raise Malformed("angles that are no numbers, or an angle_increment of 0")
    steps = (last_rad - first_rad) / step_rad
    if not beams - 1.5 <= steps <= beams + 0.5:
        raise Malformed(f"angle_max contradicts {beams} beams: it is {steps:.1f} steps after angle_min")
