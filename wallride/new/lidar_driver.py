"""A driver for a lidar whose frames are a mark, its clock [ms], the number of beams, ranges [mm], and a CRC-32."""

import asyncio
import contextlib
import math
import struct
import zlib
from collections.abc import Callable

import numpy as np

from wallride.drivers import own

MARK, HEAD = b"LDR1", struct.Struct("<4sIH")
START, STOP = b"GO\n", b"NO\n"
FIELD_RAD = math.radians(270)
RANGE_MIN_M, RANGE_MAX_M = 0.05, 12.0


class LidarDriverSettings(own.DriverSettings):
    """Settings; they stand in the settings file below [lidar.own]."""

    address: str = "serial:///dev/ttyUSB0?baud=921600"
    """Address: serial:///dev/NAME?baud=RATE or tcp://HOST:PORT"""


class LidarDriver:
    """Implements `Lidar` of wallride.drivers.api."""

    Settings = LidarDriverSettings
    emulator = "wallride.new.lidar_emulator:LidarDevice"  # for `wallride sim`

    def __init__(self, settings: LidarDriverSettings, clock: own.Clock) -> None:
        self.settings, self.clock = settings, clock
        self.health = own.Health()
        self.sequence = 0

    async def run(self, on_scan: Callable[[own.Scan], None]) -> None:
        """Deliver scans without end; reconnect for ever."""
        while True:
            try:
                link = await own.open_link(own.parse_address(self.settings.address), self.clock)
                try:
                    await own.until_lost(link, self.serve(link, on_scan))
                finally:
                    with contextlib.suppress(own.LinkLost):
                        link.write(STOP)  # it is left quiet
                    link.close()
            except own.LinkLost as lost:
                self.health.link, self.health.message = own.LinkState.ABSENT, str(lost)
            await asyncio.sleep(0.5)

    async def serve(self, link: own.ByteLink, on_scan: Callable[[own.Scan], None]) -> None:
        """Use one connection until it is lost, or silent."""
        buffer, least_s, heard_s = bytearray(), math.inf, self.clock()

        def on_bytes(chunk: bytes, read_at_s: float) -> None:
            nonlocal least_s, heard_s
            buffer.extend(chunk)
            frames = list(iter(lambda: take(buffer), None))
            # A frame that waited somewhere is late by its own clock, beside the quickest one, maybe of this chunk.
            least_s = min([least_s + 1e-5 * len(frames), *(read_at_s - sent_s for sent_s, _ in frames)])
            for sent_s, ranges_m in frames:
                heard_s = read_at_s
                self.health.link, self.health.message = own.LinkState.READY, f"{ranges_m.size} beams"
                self.health.identity = "example lidar"
                self.sequence += 1
                stamp_s, step_rad = min(sent_s + least_s, read_at_s), FIELD_RAD / (ranges_m.size - 1)
                facts = -FIELD_RAD / 2, step_rad, RANGE_MIN_M, RANGE_MAX_M
                on_scan(own.Scan(stamp_s, read_at_s, *facts, ranges_m, self.sequence))

        link.listen(on_bytes)
        link.write(START)
        while True:
            await asyncio.sleep(0.1)
            if self.clock() - heard_s > 1.0:
                raise own.LinkLost(f"{link.address}: silent (power? cable?)")


def take(buffer: bytearray) -> tuple[float, np.ndarray] | None:
    """Cut the next whole frame off the buffer: its time by the lidar's clock [s], ranges (n,) [m]; None without one."""
    while (at := buffer.find(MARK)) >= 0:
        del buffer[:at]
        if len(buffer) < HEAD.size:
            return None
        _, sent_ms, beams = HEAD.unpack_from(buffer)
        end = HEAD.size + 2 * beams
        if len(buffer) < end + 4:
            return None
        body, crc = bytes(buffer[:end]), int.from_bytes(buffer[end : end + 4], "little")
        if zlib.crc32(body) == crc and beams > 1:
            del buffer[: end + 4]
            ranges_m = np.frombuffer(body[HEAD.size :], "<u2").astype(np.float32) / np.float32(1000)
            ranges_m[(ranges_m < RANGE_MIN_M) | (ranges_m > RANGE_MAX_M)] = np.nan
            return sent_ms / 1000, ranges_m
        del buffer[:1]
    del buffer[:-3]
    return None
