"""Over a poor radio: nothing that waited moves the car, and what a client hears there is not old."""

import asyncio
import time

import numpy as np
import pytest

from tests.system.operated import HAND_MPS, operated
from tests.system.poor_link import NAMES, PoorLink, Quality, measure
from wallride.runtime.wire import topics

STALL_S = 3.0
EXPIRY_S = 0.5
"""The default of 0.2 s is less than this link takes: there the car stops again and again, rightly."""
OLD_S = 2.0
"""Without bounds on what a link keeps, the age at 1 Mbit/s is 4.5 s after 15 s, and grows."""


@pytest.mark.timeout(90)
async def test_what_waited_in_a_stall_of_3_s_moves_nothing(tmp_path):
    async with operated(tmp_path, f"operator.expiry_s={EXPIRY_S}") as scene:
        link = PoorLink(int(scene.radio.endpoint.rpartition(":")[2]), Quality(loss=0.0))
        await link.start()
        scene.entrance = link.endpoint
        try:
            process = await scene.operator("0,,0,0", "0.1,manual,0,0", "0.2,manual,1,0.1")
            await scene.car.until(lambda: scene.car.wheel_mps > 0.9 * HAND_MPS, "driving by hand over the link", 30.0)
            link.stall(STALL_S)
            stalled_s = time.monotonic()
            brake_s = await scene.brake_after(stalled_s)
            assert brake_s - stalled_s < EXPIRY_S + 0.25
            await asyncio.sleep(STALL_S + 2.0)
            assert process.exit_code is None
            assert not scene.moves_after(brake_s + 0.05), "the operator holds everything, and released nothing"
        finally:
            await link.close()


@pytest.mark.timeout(90)
async def test_a_link_of_1_mbit_loses_scans_and_hears_nothing_old():
    ages = await measure(Quality(rate_bps=1e6), 12.0, 0.0, NAMES)
    shares = {name: len(ages.age_s[name]) / ages.sent[name] for name in (topics.SCAN, topics.STATUS)}
    assert np.percentile(ages.age_s[topics.BEAT], 95) < OLD_S
    assert np.percentile(ages.age_s[topics.SCAN], 95) < OLD_S
    assert shares[topics.SCAN] < shares[topics.STATUS], "scans are what is thinned"
