"""What `render` shows: the world from above around the car, with its scan and the way it came."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from wallride.sim.world.pose import CAR, Floats, Pose

SIZE_PX = 480
VIEW_M = 16.0
_PAPER, _WALL, _WAY, _SCAN, _CAR = "white", "#404040", "#1f77b4", "#d62728", "#ff7f0e"


def picture(
    pose: Pose, segments_m: Floats, points_m: Floats, way: Sequence[tuple[float, float]]
) -> npt.NDArray[np.uint8]:
    """Return (SIZE_PX, SIZE_PX, 3) bytes, red, green, blue: VIEW_M of the world, the car in the middle.

    segments_m: of walls and obstacles, (n, 4). points_m: of the scan in the world, (n, 2). way: places so far.
    """
    image = Image.new("RGB", (SIZE_PX, SIZE_PX), _PAPER)
    draw = ImageDraw.Draw(image)
    ends = _pixels(pose, segments_m.reshape(-1, 2)).reshape(-1, 4)
    seen = (np.minimum(ends[:, :2], ends[:, 2:]) < SIZE_PX) & (np.maximum(ends[:, :2], ends[:, 2:]) >= 0)
    for line in ends[seen.all(axis=1)].tolist():
        draw.line(line, fill=_WALL, width=2)
    if len(way) > 1:
        draw.line(_pixels(pose, np.array(way)).ravel().tolist(), fill=_WAY, width=2)
    draw.point(_pixels(pose, points_m).ravel().tolist(), fill=_SCAN)
    corners = [pose.ahead(forward_m, left_m) for forward_m, left_m in CAR.corners()]
    draw.polygon(_pixels(pose, np.array([(at.x_m, at.y_m) for at in corners])).ravel().tolist(), outline=_CAR, width=2)
    return np.array(image)


def _pixels(middle: Pose, places_m: Floats) -> Floats:
    """Return places in the world, (n, 2), as columns and rows of the picture."""
    return SIZE_PX / 2 + (places_m - (middle.x_m, middle.y_m)) * (SIZE_PX / VIEW_M) * (1.0, -1.0)
