"""The tests that every lidar's driver has to pass, and one of this one. Needs pytest."""

import numpy as np

from wallride.drivers.conformance import EmulatorBench, LidarConformance
from wallride.new.lidar_driver import START, LidarDriver, take
from wallride.new.lidar_emulator import LidarDevice


class TestLidarDriver(LidarConformance):
    """See docs/your-own-driver.md for what it checks."""

    def bench(self) -> EmulatorBench:
        """Return the emulator behind a port."""
        return EmulatorBench(LidarDriver, LidarDevice())


def test_a_damaged_frame_is_none() -> None:
    """The CRC tells."""
    emulator = LidarDevice()
    emulator.feed(START, 0.0)
    frame = emulator.scan(np.full(541, 2.0), 1.0)
    assert take(bytearray(frame)) is not None
    for at in range(len(frame)):
        assert take(bytearray(frame[:at] + bytes([frame[at] ^ 1]) + frame[at + 1 :])) is None
