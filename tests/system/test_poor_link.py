"""Over a poor radio: nothing that waited moves the car, and what a client hears there is not old."""

import asyncio
import time

import numpy as np
import pytest

from tests.system.operated import HAND_MPS, operated
from tests.system.poor_link import NAMES, PoorLink, Quality, measure
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import BYTES, CDR, MAX_SAMPLE_BYTES
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import car_config, client_config

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


@pytest.mark.timeout(60)
async def test_the_largest_map_arrives_over_1_mbit_beside_scans_and_holds_up_nothing():
    """With zenoh's own queue of two batches it arrived over no radio at all, and its fragments waited 2 ms in vain."""
    endpoint = free_endpoint()
    car = CarBus(car_config([endpoint], None, (), "car1"))
    await car.open()
    link = PoorLink(int(endpoint.rpartition(":")[2]), Quality(rate_bps=1e6, loss=0.0))
    await link.start()
    client = Bus(client_config(link.endpoint, None))
    maps, ages_s = [], []
    client.subscribe(topics.key("car1", topics.MAP), lambda _key, payload, _s: maps.append(payload))
    client.subscribe(topics.key("car1", topics.SCAN), lambda *_: None)
    client.subscribe(
        topics.key("car1", topics.BEAT), lambda _key, payload, arrival_s: ages_s.append(arrival_s - float(payload))
    )
    try:
        await client.open()
        sent, held_s = bytes(MAX_SAMPLE_BYTES - 1024), 0.0
        for number in range(160):
            before_s = time.monotonic()
            if number == 40:
                car.put(topics.key("car1", topics.MAP), sent, encoding=CDR)
            car.put(topics.key("car1", topics.SCAN), bytes(4400), encoding=CDR)
            car.put(topics.key("car1", topics.BEAT), str(before_s).encode(), encoding=BYTES, urgent=True)
            held_s = max(held_s, time.monotonic() - before_s)
            await asyncio.sleep(0.05)
            if maps:
                break
    finally:
        await client.close()
        await link.close()
        await car.close()
    assert maps == [sent]
    assert np.percentile(ages_s, 95) < OLD_S
    assert held_s < 0.02
