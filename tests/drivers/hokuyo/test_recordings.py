"""Every recording of a real UST-10LX, from the sensor's bytes over TCP to scans, on the recorded clock."""

import asyncio
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from wallride.drivers.api import Scan
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.hokuyo.timing import DRIFT, WRAP_MS, ClockReading, StampGate
from wallride.sim.devices.scip import ScipEmulator

FOLDER = Path(__file__).resolve().parents[3] / ".." / "shared" / "data" / "racecar"
FILES = sorted(path.stem for path in FOLDER.glob("*.npz") if "no_scan" not in path.stem)
FOREIGN = {"t3_foreign_publishers": 259 + 141}
STALE_AFTER_S = 0.1
SWEEP_S = 0.019


class Recording:
    """Ranges as integers, arrival on the recorder's clock, and the stamps as a 24-bit counter about to wrap."""

    def __init__(self, name: str) -> None:
        with np.load(FOLDER / f"{name}.npz") as data:
            self.ranges_mm = np.round(data["ranges"].astype(np.float64) * 1000).astype(np.int64)
            self.arrival_s = data["recv"] - data["recv"][0] + 1000.0
            self.stamps_ms = np.round((data["stamps"] - data["stamps"][0]) * 1000).astype(np.int64) + WRAP_MS - 3000

    def predict(self) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Return which scans are another lidar's, and which are late; from the data, not the way the driver does it."""
        delay_s = self.arrival_s - self.stamps_ms / 1000
        foreign = np.abs(delay_s - delay_s[0]) > 10
        trend_s = (delay_s - DRIFT * self.arrival_s)[~foreign]
        late_s = trend_s - np.minimum.accumulate(trend_s)
        assert np.abs(late_s - STALE_AFTER_S).min() > 1e-4, "a scan on the very limit proves nothing"
        stale = np.zeros(len(foreign), bool)
        stale[~foreign] = late_s > STALE_AFTER_S
        return foreign, stale


@pytest.mark.skipif(not FILES, reason="the recordings (shared/data/racecar) are not here")
def test_there_are_all_recordings() -> None:
    assert len(FILES) == 17


@pytest.mark.parametrize("name", FILES)
async def test_every_scan_of_the_recording_comes_out_as_it_was_measured(name: str) -> None:
    recording = Recording(name)
    foreign, stale = recording.predict()
    scans, counts = await play(recording)
    used = ~foreign & ~stale
    assert counts == {word: int(mask.sum()) for word, mask in (("foreign", foreign), ("stale", stale)) if mask.any()}
    assert int(foreign.sum()) == FOREIGN.get(name, 0)
    assert [scan.sequence for scan in scans] == np.flatnonzero(used).tolist()
    ranges_mm = np.stack([scan.ranges_m for scan in scans]).astype(np.float64) * 1000
    expected_mm = recording.ranges_mm[used]
    valid = (expected_mm >= 20) & (expected_mm <= 30000)
    np.testing.assert_array_equal(np.isnan(ranges_mm), ~valid)
    np.testing.assert_array_equal(np.round(ranges_mm[valid]), expected_mm[valid])
    np.testing.assert_allclose([scan.received_s for scan in scans], recording.arrival_s[used], rtol=0, atol=1e-9)
    check_stamps(np.array([scan.stamp_s for scan in scans]), recording.stamps_ms[used] / 1000)


def check_stamps(stamps_s: npt.NDArray[np.float64], sensor_s: npt.NDArray[np.float64]) -> None:
    """Our stamps follow the sensor's own clock, whatever the delays: the distance only sinks as prompter scans come."""
    distance_s = stamps_s - sensor_s
    assert np.diff(distance_s).max() < 0.010  # DRIFT over the longest hole
    assert np.ptp(distance_s) < 0.025
    assert (np.diff(stamps_s) > 0).all()


async def play(recording: Recording) -> tuple[list[Scan], dict[str, int]]:
    """Send the recording through the emulator and the driver as fast as it goes; return the scans and the counts."""
    now_s = recording.arrival_s[0] - 0.025
    emulator = ScipEmulator(clock=lambda: now_s)
    emulator.sensor.ahead_ms = recording.stamps_ms[0] - now_s * 1000
    port = await emulator.start_tcp()
    settings = HokuyoSettings(address=f"tcp://127.0.0.1:{port}", silent_after_s=60.0, stale_after_s=STALE_AFTER_S)
    driver = Hokuyo(settings, clock=lambda: now_s)
    scans: list[Scan] = []
    task = asyncio.create_task(driver.run(scans.append))
    async with asyncio.timeout(20):
        while not emulator.streaming:
            await asyncio.sleep(0.005)
        await asyncio.sleep(0.01)
        rows = zip(recording.arrival_s, recording.stamps_ms, recording.ranges_mm, strict=True)
        for number, (arrival_s, stamp_ms, ranges_mm) in enumerate(rows, 1):
            now_s = arrival_s
            assert emulator.publish(ranges_mm, int(stamp_ms)) is not None
            while len(scans) + sum(driver.health.counts.values()) < number:
                await asyncio.sleep(0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    emulator.close()
    return scans, driver.health.counts


@pytest.mark.parametrize("name", FILES)
def test_every_scan_that_comes_over_a_late_link_is_judged_as_old_as_it_is(name: str) -> None:
    recording = Recording(name)
    sensor_s = recording.stamps_ms / 1000
    ours = ~recording.predict()[0]
    prompt_s = (recording.arrival_s - sensor_s)[ours].min()  # from a stamp to the arrival of its scan in time
    asked_s = recording.arrival_s[0] - 0.5
    counter_ms = round((asked_s - prompt_s + SWEEP_S) * 1000)
    for late_s in (0.0, 0.05, 0.1, 0.15, 0.5, 1.0):
        gate = StampGate(STALE_AFTER_S, lambda _what: None)
        gate.restart(late_s + 0.001, ClockReading(counter_ms, asked_s, asked_s + late_s + 0.001), 0.025)
        arrivals_s, late = recording.arrival_s[ours] + late_s, []
        for arrival_s, stamp_ms in zip(arrivals_s, recording.stamps_ms[ours].tolist(), strict=True):
            judged_s = gate.accept(stamp_ms, arrival_s)
            if judged_s is not None:
                late.append(arrival_s - stamp_ms / 1000 - prompt_s - judged_s)
        assert gate.dated
        assert max(late, default=0.0) < 0.025 - SWEEP_S + DRIFT * float(np.ptp(arrivals_s)) + 0.002
        assert bool(late) == (late_s < STALE_AFTER_S + 0.025 - SWEEP_S)
