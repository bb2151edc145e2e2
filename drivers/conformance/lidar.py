"""The contract of `Lidar` in `drivers/api.py`, as tests against a bench."""

import asyncio
import random

import numpy as np

from wallride.drivers.api import Scan
from wallride.drivers.conformance.bench import LidarBench, room_m
from wallride.drivers.conformance.device_run import ENDS_S, DeviceConformance, DeviceRun
from wallride.drivers.conformance.port import now_s
from wallride.drivers.scan_check import ScanCheck

NOTICED_S = 2.5
"""Maximum time in which a silent or lost device is no longer READY."""
FRESH_S = 0.15
STALL_S = 0.7
FIRST_STALL_S = 0.3


class CarFailedError(Exception):
    """Raised by the kit in the driver's callback."""


class LidarRun(DeviceRun[LidarBench]):
    """A driver that runs against a bench; judges every scan as it comes."""

    patience_s = 12.0

    def __init__(self, bench: LidarBench) -> None:
        super().__init__(bench, self.on_scan)
        self.scans: list[Scan] = []
        self.faults: list[str] = []
        self._check = ScanCheck()

    def on_scan(self, scan: Scan) -> None:
        """Take a scan."""
        if fault := self._check.fault(scan, now_s()):
            self.faults.append(fault)
        self.scans.append(scan)

    def judge(self) -> None:
        """Raise AssertionError for a scan that breaks the contract."""
        assert not self.faults, f"the driver {self.faults[0]}"

    async def more(self, count: int = 3) -> list[Scan]:
        """Wait for further scans."""
        before = len(self.scans)
        await self.until(lambda: len(self.scans) >= before + count, "scans")
        return self.scans[before:]


class LidarConformance(DeviceConformance[LidarBench, LidarRun]):
    """Subclass it as TestSomething, with `bench`."""

    run_class = LidarRun

    def test_it_shows_the_room_the_right_way_round(self) -> None:
        """Bearings by REP-103, metres, NaN where nothing returns, fresh stamps, READY."""

        async def body(drive: LidarRun) -> None:
            for scan in (await drive.more(5))[1:]:
                steps = np.arange(scan.ranges_m.size, dtype=np.float64)
                bearing_rad = np.asarray(scan.angle_min_rad + scan.angle_step_rad * steps, np.float64)
                off_m = np.abs(scan.ranges_m - room_m(bearing_rad))
                assert np.nanquantile(off_m, 0.93) < 0.06, "the ranges are not the room's (mirrored? turned? unit?)"
                silent = np.isnan(room_m(bearing_rad))
                assert np.isnan(scan.ranges_m[silent]).mean() > 0.9, "NaN where nothing returns"
                assert np.isnan(scan.ranges_m[~silent]).mean() < 0.1, "NaN where something returns"
                assert scan.received_s - scan.stamp_s < FRESH_S, "a fresh scan is stamped as an old one"
            assert drive.is_ready(), "scans come, and health.link is not READY"
            assert drive.driver.health.identity, "health.identity says which device it is"

        self.drive(body)

    def test_it_reconnects_for_ever(self) -> None:
        """Unplugged it is not READY and delivers nothing; plugged in again it goes on, the third time as well."""

        async def body(drive: LidarRun) -> None:
            for _ in range(3):
                await drive.more()
                await drive.bench.unplug()
                await drive.until(lambda: not drive.is_ready(), "not READY when unplugged", NOTICED_S)
                count = len(drive.scans)
                await drive.run_for(0.3)
                assert len(drive.scans) == count, "scans of a device that is not there"
                await drive.bench.replug()
            await drive.more()
            assert drive.is_ready()

        self.drive(body)

    def test_silence_is_noticed_and_nothing_is_repeated(self) -> None:
        """A device that says no more gives no scan, and is not READY."""

        async def body(drive: LidarRun) -> None:
            await drive.more()
            drive.bench.silence = True
            await drive.run_for(0.1)
            count = len(drive.scans)
            await drive.until(lambda: not drive.is_ready(), "not READY in silence", NOTICED_S)
            assert len(drive.scans) == count, "scans of a device that is silent"
            drive.bench.silence = False
            await drive.more()

        self.drive(body)

    def test_what_waited_is_as_old_as_its_measurement(self) -> None:
        """After a stalled link no scan is stamped as fresh that was measured before."""

        async def body(drive: LidarRun) -> None:
            steady = await drive.more(8)
            period_s = float(np.median(np.diff([scan.stamp_s for scan in steady])))
            drive.bench.hold()
            await drive.run_for(STALL_S)
            before, released_s = len(drive.scans), now_s()
            drive.bench.release()
            await drive.more(4)
            burst = [scan for scan in drive.scans[before:] if scan.received_s < released_s + 0.03]
            spread_s = burst[-1].stamp_s - burst[0].stamp_s if burst else 0.0
            assert spread_s > (len(burst) - 1.5) * period_s / 2, "a burst of old scans is stamped with its arrival"
            fresh = [scan for scan in burst if released_s - scan.stamp_s < FRESH_S]
            assert len(fresh) <= 2 + FRESH_S / period_s, "old scans are stamped as fresh"

        self.drive(body)

    def test_scans_that_come_first_and_together_have_stamps_of_their_own(self) -> None:
        """The driver does not know yet how quick the link is, and two scans are in one read."""

        async def body(drive: LidarRun) -> None:
            for _ in range(2):
                drive.bench.hold()
                await drive.run_for(FIRST_STALL_S)
                drive.bench.release()
                await drive.more(4)
                await drive.bench.unplug()
                await drive.until(lambda: not drive.is_ready(), "not READY when unplugged", NOTICED_S)
                await drive.bench.replug()

        self.drive(body)

    def test_noise_on_the_line_is_survived(self) -> None:
        """Random bytes end nothing, become no scan that breaks the contract, and it goes on afterwards."""

        async def body(drive: LidarRun) -> None:
            await drive.more()
            noise = random.Random(5)
            for _ in range(60):
                drive.bench.send(noise.randbytes(noise.choice([1, 7, 64, 900])))
                await drive.run_for(0.01)
            await drive.more(5)
            assert drive.is_ready()

        self.drive(body)

    def test_it_ends_when_it_is_cancelled(self) -> None:
        """At once, whatever it waits for, and the port is closed."""

        async def body(drive: LidarRun) -> None:
            await drive.more()
            await _ends(drive)

        async def body_without_device(drive: LidarRun) -> None:
            await drive.bench.unplug()
            await asyncio.sleep(0.2)
            await _ends(drive)

        self.drive(body)
        self.drive(body_without_device)

    def test_an_error_of_the_car_is_not_swallowed(self) -> None:
        """What `on_scan` raises ends the run: else a car whose code fails would go on without a word."""

        async def body(drive: LidarRun) -> None:
            def fail(_scan: Scan) -> None:
                raise CarFailedError

            drive.task.cancel()
            await asyncio.wait({drive.task}, timeout=ENDS_S)
            await drive.bench.replug()
            drive.driver = drive.bench.driver()
            drive.task = asyncio.create_task(drive.driver.run(fail))
            try:
                await drive.until(lambda: False, "the end")
            except CarFailedError:
                return

        self.drive(body)


async def _ends(drive: LidarRun) -> None:
    await drive.end()
    await asyncio.sleep(0.05)
    assert not drive.bench.connected, "the port stays open"
