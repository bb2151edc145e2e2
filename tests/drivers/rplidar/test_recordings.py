"""Points of five real RPLIDAR C1 in one room, sent as the sensor would send them and put on a grid."""

from pathlib import Path

import numpy as np
import pytest

from wallride.drivers.rplidar.codec import PlainDecoder
from wallride.drivers.turning.grid import STILL, Mount, cells_for, resample
from wallride.drivers.turning.turns import Turns

FOLDER = Path(__file__).resolve().parents[3] / ".." / "shared" / "data" / "rplidar"
FILES = sorted(FOLDER.glob("*.npz")) if FOLDER.is_dir() else []
NEAREST_M, FARTHEST_M = 0.05, 12.0
SAMPLE_S = 1 / 5000


def node(deg: float, range_m: float, *, starts: bool) -> bytes:
    angle, distance = round(deg * 64) % (360 * 64), round(range_m * 4000)
    return bytes([60 | (1 if starts else 2), (angle & 127) << 1 | 1, angle >> 7]) + distance.to_bytes(2, "little")


@pytest.mark.skipif(not FILES, reason="the recordings (shared/data/rplidar) are not here")
@pytest.mark.parametrize("device", range(1, 6))
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_real_turn_becomes_a_scan_that_loses_no_obstacle(path, device):
    points = np.load(path)
    if f"dev{device}_xy" not in points:
        pytest.skip(f"{path.stem} has no device {device}")
    x_m, y_m = points[f"dev{device}_xy"].astype(np.float64).T
    deg, range_m = np.degrees(-np.arctan2(y_m, x_m)) % 360.0, np.hypot(x_m, y_m)
    order = np.argsort(deg)
    nodes = [node(deg[k], range_m[k], starts=place == 0) for place, k in enumerate(order)]
    turns = Turns(SAMPLE_S, Mount().cut_deg, lambda _what: None)
    decoder, found = PlainDecoder(pytest.fail), []
    for turn in range(3):
        for first in range(0, len(nodes), 50):
            part = decoder.feed(b"".join(nodes[first : first + 50]))
            found += turns.add(part, (turn * len(nodes) + first + part.count) * SAMPLE_S)
    assert found[-1].deg.size == len(nodes)
    count = cells_for(len(nodes))
    scan_m = resample(found[-1], STILL, Mount(), count, NEAREST_M, FARTHEST_M)
    usable = (range_m >= NEAREST_M + 0.001) & (range_m <= FARTHEST_M - 0.001)
    cell = np.rint((np.radians(-(np.round(deg * 64) / 64)) + np.pi) / (2 * np.pi / count)) % count
    for one, one_m in zip(cell[usable].astype(int), range_m[usable], strict=True):
        assert min(scan_m[one], scan_m[one - 1], scan_m[(one + 1) % count]) <= one_m + 0.001
    assert np.nanmin(scan_m) <= range_m[usable].min() + 0.001
    assert count >= 360
    assert np.isfinite(scan_m).mean() > 0.5
