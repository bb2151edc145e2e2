"""Markers for Foxglove, Lichtblick and RViz: lines and points in base_link as visualization_msgs/MarkerArray."""

from collections.abc import Sequence
from enum import IntEnum
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from wallride.drivers.value import value
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.cdr import ENCAPSULATION, CdrWriter, Template
from wallride.runtime.ros.messages import BASE, NOTHING, Floats, header, split_time

LIFETIME_S = 0.6
"""Lifetime of a marker that is not renewed."""
POINT_BYTES = 3 * 8
Color = tuple[float, float, float, float]
GREEN: Color = (0.2, 0.8, 0.3, 1.0)
BLUE: Color = (0.2, 0.5, 1.0, 1.0)
ORANGE: Color = (1.0, 0.6, 0.1, 1.0)
RED: Color = (0.95, 0.2, 0.2, 1.0)


class MarkerType(IntEnum):
    """Connection of a marker's points; the values are the message's."""

    LINE_STRIP = 4
    LINE_LIST = 5
    POINTS = 8


@value(eq=False)
class Marker:
    """One marker. name: unique on its topic. points_m: (2, n), base_link."""

    name: str
    kind: MarkerType
    points_m: Floats
    color: Color
    width_m: float = 0.03


def marker_array(stamp_ns: int, markers: Sequence[Marker]) -> bytes:
    """Return visualization_msgs/MarkerArray."""
    message = bytearray(ENCAPSULATION + len(markers).to_bytes(4, "little"))
    stamp, points, at = split_time(stamp_ns), _points(markers), 0
    for marker in markers:
        count = marker.points_m.shape[1]
        before = (len(message) - len(ENCAPSULATION)) % 8
        head = _head(before, marker.name, marker.kind, marker.color, marker.width_m, filled=count > 0)
        message += head.fill(*stamp, count)[len(ENCAPSULATION) + before :]
        message += points[at : at + count * POINT_BYTES]
        message += _TAIL
        at += count * POINT_BYTES
    return bytes(message)


def _points(markers: Sequence[Marker]) -> bytes:
    """Return the points of all markers, one after the other, as x, y, 0."""
    if not markers:
        return b""
    points: npt.NDArray[np.float64] = np.zeros((sum(marker.points_m.shape[1] for marker in markers), 3))
    np.concatenate([marker.points_m for marker in markers], axis=1, out=points.T[:2])
    return points.tobytes()


@lru_cache(maxsize=256)
def _head(before: int, name: str, kind: MarkerType, color: Color, width_m: float, *, filled: bool) -> Template:
    """Return the part in front of the points, from the time to their number.

    before: its offset in bytes after a multiple of 8, with which it begins. filled: there are points.
    """
    out = Template()
    out.put("B" * before, *bytes(before))
    out.holes("iI")
    add = 0
    out.text(BASE)
    out.text(name)
    out.put("iii", 0, kind, add)
    out.put("ddddddd", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    out.put("ddd", width_m, width_m, width_m)
    out.put("ffff", *color)
    out.put("iI?", 0, round(LIFETIME_S * NS), False)  # noqa: FBT003 - not locked to its frame
    out.holes("I")
    if filled:
        out.align(8)  # doubles
    return out


def _tail() -> bytes:
    out = CdrWriter()
    out.sequence("f", NOTHING)  # a colour for each point
    out.text("")  # texture
    header(out, 0, "")
    out.text("")
    out.sequence("B", NOTHING)
    out.sequence("f", NOTHING)
    out.text("")  # text
    out.text("")  # mesh
    out.text("")
    out.sequence("B", NOTHING)
    out.put("?", False)  # noqa: FBT003 - no materials
    return out.done()[len(ENCAPSULATION) :]


_TAIL = _tail()
