"""The lidar's side of its protocol, without a port: for the tests of its driver, and for `wallride sim`."""

import math
import zlib

import numpy as np

from wallride.new.lidar_driver import FIELD_RAD, HEAD, MARK, START, STOP


class LidarDevice:
    """Measures 541 beams in 270 degrees, 25 times a second, once it was told to."""

    rate_hz = 25.0

    def __init__(self) -> None:
        self.bearings_rad = np.linspace(-FIELD_RAD / 2, FIELD_RAD / 2, 541)
        self.measures = False
        self._heard = b""

    def feed(self, data: bytes, now_s: float) -> bytes:  # noqa: ARG002 - it has no timeout
        """Take bytes of the driver; it answers nothing."""
        *lines, self._heard = (self._heard + data).split(b"\n")
        for line in lines:
            self.measures = {START: True, STOP: False}.get(line + b"\n", self.measures)
        return b""

    def scan(self, ranges_m: np.ndarray, now_s: float) -> bytes:
        """Return one frame; b"" while it does not measure."""
        if not self.measures:
            return b""
        mm = np.nan_to_num(np.minimum(ranges_m, 60.0) * 1000, nan=0.0)
        sent_ms = math.floor(now_s * 1000) % 2**32
        body: bytes = HEAD.pack(MARK, sent_ms, mm.size) + np.rint(mm).astype("<u2").tobytes()
        return body + zlib.crc32(body).to_bytes(4, "little")
