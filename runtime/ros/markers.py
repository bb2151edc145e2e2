"""Drawings for Foxglove, Lichtblick and RViz: lines and points in base_link as visualization_msgs/MarkerArray."""

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from drivers.value import value
from runtime.ros.cdr import CdrWriter
from runtime.ros.messages import BASE, NOTHING, NS, Floats, header

LIFETIME_S = 0.6
"""A drawing that nobody renews disappears by itself."""
Color = tuple[float, float, float, float]
GREEN: Color = (0.2, 0.8, 0.3, 1.0)
BLUE: Color = (0.2, 0.5, 1.0, 1.0)
ORANGE: Color = (1.0, 0.6, 0.1, 1.0)
RED: Color = (0.95, 0.2, 0.2, 1.0)


class Kind(IntEnum):
    """How the points are joined; the values are the message's."""

    LINE_STRIP = 4
    LINE_LIST = 5
    POINTS = 8


@value(eq=False)
class Marker:
    """One drawing. name: unlike that of every other drawing on its topic. points_m: (2, n), base_link."""

    name: str
    kind: Kind
    points_m: Floats
    color: Color
    width_m: float = 0.03


def marker_array(stamp_ns: int, markers: Sequence[Marker]) -> bytes:
    """Return visualization_msgs/MarkerArray."""
    out = CdrWriter()
    out.put("I", len(markers))
    for marker in markers:
        _marker(out, stamp_ns, marker)
    return out.done()


def _marker(out: CdrWriter, stamp_ns: int, marker: Marker) -> None:
    out.put("iI", *divmod(stamp_ns, NS))
    out.again(_before_points, marker.name, marker.kind, marker.color, marker.width_m)
    points: npt.NDArray[np.float64] = np.zeros((marker.points_m.shape[1], 3))
    points[:, :2] = marker.points_m.T
    out.put("I", points.shape[0])
    if points.size:
        out.array("d", points)
    out.again(_after_points)


def _before_points(out: CdrWriter, name: str, kind: Kind, color: Color, width_m: float) -> None:
    add = 0
    out.text(BASE)
    out.text(name)
    out.put("iii", 0, kind, add)
    out.put("ddddddd", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    out.put("ddd", width_m, width_m, width_m)
    out.put("ffff", *color)
    out.put("iI?", 0, round(LIFETIME_S * NS), False)  # noqa: FBT003 - not locked to its frame


def _after_points(out: CdrWriter) -> None:
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
