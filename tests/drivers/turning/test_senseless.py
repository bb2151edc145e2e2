"""Turning lidars that tell what makes no sense: a fault that is said, and no scan that shows it."""

import struct
from functools import reduce
from itertools import pairwise
from operator import xor

import numpy as np
import pytest

from tests.drivers.turning.test_driver import emulated, sensor
from wallride.drivers.api import Health, LinkState
from wallride.drivers.rplidar import codec
from wallride.drivers.turning.grid import Motion, Mount
from wallride.drivers.turning.stream import StreamFacts, Turning, TurnStream
from wallride.drivers.ydlidar.codec import PacketDecoder
from wallride.drivers.ydlidar.models import MODELS
from wallride.sim.devices import rplidar
from wallride.sim.devices.rplidar import RplidarDevice

PLAIN_S = 1 / 2000
TYPICAL_MODE, US_PER_SAMPLE, MAX_DISTANCE, MODE_NAME = 0x7C, 0x71, 0x74, 0x7F


def told_as(device, key, value):
    """Have a sensor tell something else of its mode."""
    tells = device._configuration
    wrong = rplidar._reply(0x20, key.to_bytes(4, "little") + value)
    device._configuration = lambda asked: [wrong] if asked == key else tells(asked)
    return device


@pytest.mark.parametrize(
    ("key", "value"),
    [
        (TYPICAL_MODE, b"\x01\x01"),
        (TYPICAL_MODE, b"\x01\x00\x01\x00"),
        (US_PER_SAMPLE, b"\xff" * 200),
        (MAX_DISTANCE, b"\xff" * 200),
        (MAX_DISTANCE, b"\xff" * 4),
        (MAX_DISTANCE, b"\x01"),
    ],
)
async def test_a_mode_that_makes_no_sense_is_said_and_not_driven_by(plugged, key, value):
    rig = await plugged(emulated(told_as(RplidarDevice(rplidar.S2), key, value)))
    await rig.run_for(3.0)
    assert "makes no sense" in rig.health.message or rig.link() is LinkState.READY  # what follows 4 bytes is not read
    assert all(0.15 < scan.range_max_m <= 100 for scan in rig.scans)


async def test_the_name_of_a_mode_is_shown_as_text(plugged):
    rig = await plugged(emulated(told_as(RplidarDevice(rplidar.S2), MODE_NAME, b"\x1b[2J\rready\n\x07\0")))
    await rig.more_scans(2)
    assert rig.health.message.isprintable()


@pytest.mark.parametrize("name", ["a1", "a3", "c1", "s2", "s3"])
async def test_a_head_that_stands_and_trembles_shows_its_direction_nowhere_else(plugged, name, monkeypatch):
    emulator, rng = sensor(name), np.random.default_rng(3)
    rig = await plugged(emulator)
    await rig.more_scans(3)
    frames = emulator.device.frames
    tremble = lambda deg, mm: frames((deg + rng.normal(0, 0.05, deg.size)) % 360, mm)  # noqa: E731 - one line
    monkeypatch.setattr(emulator.device, "frames", tremble)
    emulator.blocked = True
    before = len(rig.scans)
    await rig.run_for(3.0)
    assert len(rig.scans) - before <= 1  # the turn that it was in


def streamed(decoder_of, sample_s, range_m, name):
    """Return a stream, its health, and the scans that it delivers."""
    scans, numbers, health = [], iter(range(10_000)), Health()
    facts = StreamFacts(decoder_of(health.count), sample_s, range_m[0], range_m[1], name)
    stream = TurnStream(facts, Turning(Mount(), 0.1, 0.0, Motion), health, lambda: next(numbers), scans.append)
    return stream, health, scans


def packet(first_deg, last_deg, mm):
    ends = [round(deg * 64) % 23040 << 1 | 1 for deg in (first_deg, last_deg)]
    samples = [round(one * 4) for one in mm]
    words = [0x55AA, len(samples) << 8, *ends]
    return struct.pack(f"<5H{len(samples)}H", *words, reduce(xor, words + samples), *samples)


def test_a_head_of_a_ydlidar_that_trembles_makes_no_scans():
    model, rng = MODELS["x4"], np.random.default_rng(3)
    stream, _, scans = streamed(lambda count: PacketDecoder(model, count), model.sample_s, model.range_m, "X4")
    at_s = 100.0
    for number in range(18 * 6):  # six turns of 18 packets, then it stands
        at_s += 40 * model.sample_s
        stream.on_bytes(packet(number * 20.0, number * 20.0 + 19.5, 2000 + rng.normal(0, 5, 40)), at_s)
    turned = len(scans)
    assert turned > 2
    for _ in range(500):
        at_s += 40 * model.sample_s
        first_deg, last_deg = 45.0 + rng.normal(0, 0.05, 2)
        stream.on_bytes(packet(first_deg, last_deg, 8000 + rng.normal(0, 20, 40)), at_s)
    assert len(scans) == turned


def plain(deg, mm):
    angle, quarter = round(deg * 64) % 23040 << 1 | 1, mm * 4
    return bytes((0x3E, angle & 255, angle >> 8, quarter & 255, quarter >> 8))


def test_an_edge_behind_the_car_does_not_cut_turns_of_a_few_samples():
    """A plain sample's angle is corrected by its distance: at an edge the angles go back and forth."""
    stream, _, scans = streamed(codec.PlainDecoder, PLAIN_S, (0.15, 12.0), "A1")
    for number in range(360 * 12):
        near = 170 < number % 360 < 190 and number % 4 < 2
        stream.on_bytes(plain(number + 3.0 * near, 300 if near else 3000), 100 + number * PLAIN_S)
    assert len(scans) > 6
    assert min(np.isfinite(scan.ranges_m).sum() for scan in scans) > 200
    assert stream.turns_hz < 10


def test_samples_that_come_faster_than_they_can_be_measured_do_not_turn_time_back():
    stream, health, scans = streamed(codec.PlainDecoder, PLAIN_S, (0.15, 12.0), "A1")
    for chunk in range(40):
        samples = range(chunk * 1000, chunk * 1000 + 1000)
        stream.on_bytes(b"".join(plain(k, 1500 + (k * 7 + chunk) % 50) for k in samples), 100 + chunk / 16)
    assert len(scans) > 10
    assert all(after.stamp_s > before.stamp_s for before, after in pairwise(scans))
    assert health.counts["too fast"] > 0
