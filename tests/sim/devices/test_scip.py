"""The emulated sensor by itself: its bytes against the golden ones, its ports against a plain client."""

import asyncio
import time
import tracemalloc
from collections.abc import AsyncIterator
from typing import Any

import numpy as np
import pytest

from tests.drivers.golden import Frame, golden
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.scip_encode import (
    URG_04LX,
    UST_10LX,
    SensorModel,
    cluster_minimum,
    encode_block,
    encode_fields,
    encode_number,
    encode_samples,
    encode_scan,
)
from wallride.sim.devices.scip_sensor import ScipSensor

RECEIVED = [frame for frame in golden("scip", frames=57)["frames"] if frame["direction"] == "rx"]
CLUSTERED = 10

Client = tuple[asyncio.StreamReader, asyncio.StreamWriter]


def encode(said: Frame) -> bytes:
    """Encode a reply from the fields that the vector file gives."""
    echo = said["echo"].encode()
    if "params" in said:
        return encode_fields(echo, said["params"])
    if "state" in said:
        return encode_block(echo, said["status"], [b"%03d" % said["state"]])
    if "timestamp_ms" not in said:
        return encode_block(echo, said["status"])
    if echo == b"TM1":
        return encode_block(echo, said["status"], [encode_number(said["timestamp_ms"], 4)])
    return encode_scan(echo, said["status"], said["timestamp_ms"], encode_values(echo, said))


def encode_values(echo: bytes, said: Frame) -> bytes:
    if "echoes_mm" in said:
        return b"".join(b"&".join(encode_number(mm, 3) for mm in step) for step in said["echoes_mm"])
    values = np.array(said.get("raw", said.get("ranges_mm")))
    if "intensities" in said:
        values = np.stack([values, said["intensities"]], axis=1)
    return encode_samples(values, 2 if echo.startswith(b"MS") else 3)


@pytest.mark.parametrize(
    "frame", [frame for frame in RECEIVED if "count" not in frame["fields"]], ids=lambda f: f["name"]
)
def test_every_golden_reply_is_encoded_exactly(frame: Frame) -> None:
    assert encode(frame["fields"]).hex() == frame["hex"]


def answers(*commands: str, model: SensorModel = UST_10LX, **attributes: Any) -> list[str]:
    """Return the statuses a fresh sensor answers to commands, with a reply's data lines behind it."""
    sensor = ScipSensor(model, lambda: 1.5, lambda: None)
    for name, value in attributes.items():
        setattr(sensor, name, value)
    blocks = sensor.feed("".join(f"{command}\n" for command in commands).encode())
    assert [block.split(b"\n")[0].decode() for block in blocks] == list(commands)
    return [block.split(b"\n")[1][:-1].decode() or block.split(b"\n")[1].decode() for block in blocks]


@pytest.mark.parametrize(
    ("commands", "statuses"),
    [
        (["QT", "RS", "RT", "VV", "PP", "II", "%ST"], ["00"] * 7),
        (["BM", "BM", "QT", "BM"], ["00", "02", "00", "00"]),
        (["RB", "RB"], ["01", "00"]),
        (["TM1", "TM0", "TM0", "TM1", "QT", "TM2", "TM2", "QT"], ["04", "00", "02", "00", "0E", "00", "03", "00"]),
        (["GD0000108000", "BM", "GD0000108000"], ["10", "00", "00"]),
        (["MD0000108000000", "ME0000108000000", "MS0000108000000"], ["00"] * 3),
        (["MD0000200000000", "MD0500040000000", "MDx000108000000"], ["04", "05", "01"]),
        (["MD0000x08000000", "MD00001080x0000", "MD000010800000x", "MD0000108000x00"], ["02", "03", "07", "06"]),
        (["MD00001080", "ZZ", "SS115200", "MD0000108000000;note"], ["0C", "0E", "0E", "00"]),
    ],
)
def test_commands_are_answered_by_the_book(commands: list[str], statuses: list[str]) -> None:
    assert answers(*commands) == statuses


def test_a_urg_has_no_intensities_but_a_baud_rate() -> None:
    assert answers("ME0044072500000", "MD0000072500000", "SS019200", model=URG_04LX) == ["0E", "04", "00"]


def test_a_sensor_in_scip1_answers_e_until_it_is_told() -> None:
    sensor = ScipSensor(URG_04LX, lambda: 0.0, lambda: None)
    sensor.scip1 = True
    assert sensor.feed(b"QT\r\nSCIP2.0\rQT\n") == [b"QT\nE\n\n", b"SCIP2.0\n00P\n\n", b"QT\n00P\n\n"]


def test_a_fault_is_answered_until_it_is_cured() -> None:
    assert answers("MD0000108000000", "RS", "MD0000108000000", fault="0L") == ["0L", "00", "00"]
    uncured = answers("MD0000108000000", "RS", "BM", "MD0000108000000", fault="50", cured_by=frozenset({"RB"}))
    assert uncured == ["50", "0L", "01", "50"]


def test_a_counted_stream_counts_down_and_ends_and_skips() -> None:
    sensor = ScipSensor(UST_10LX, time.monotonic, lambda: None)
    sensor.answer(b"MD0540054200102;x")
    blocks = [sensor.scan(np.full(1081, 1000), stamp_ms) for stamp_ms in range(5)]
    echoes = [block and block.split(b"\n")[0] for block in blocks]
    assert echoes == [b"MD0540054200101;x", None, b"MD0540054200100;x", None, None]


def test_clusters_take_the_nearest_of_each_group() -> None:
    assert cluster_minimum(np.array([5, 3, 9, 1, 7]), 2).tolist() == [3, 1, 7]
    sensor = ScipSensor(UST_10LX, time.monotonic, lambda: None)
    sensor.answer(b"MD0000108010000")
    block = sensor.scan(np.arange(1081) + 1000, 0)
    assert block is not None
    assert block.split(b"\n")[3][:6] == encode_samples(np.array([1000, 1000 + CLUSTERED]), 3)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="262143"):
        encode_samples(np.array([262144]), 3)
    with pytest.raises(ValueError, match="1081 beams"):
        ScipEmulator().publish(np.zeros(3, int), 0)


@pytest.fixture
async def emulator() -> AsyncIterator[ScipEmulator]:
    emulator = ScipEmulator()
    yield emulator
    emulator.close()


SCAN = np.full(1081, 1234)


async def connect(emulator: ScipEmulator) -> Client:
    reader, writer = await asyncio.open_connection("127.0.0.1", await emulator.start_tcp())
    return reader, writer


async def ask(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, line: bytes) -> bytes:
    writer.write(line + b"\n")
    async with asyncio.timeout(2):
        return await reader.readuntil(b"\n\n")


async def test_a_scan_reaches_a_plain_client_and_publish_says_when(emulator: ScipEmulator) -> None:
    reader, writer = await connect(emulator)
    assert emulator.publish(SCAN, 1) is None
    assert await ask(reader, writer, b"MD0000108000000") == b"MD0000108000000\n00P\n\n"
    before_s = time.monotonic()
    at_s = emulator.publish(SCAN, 1)
    assert at_s is not None
    assert before_s <= at_s <= time.monotonic()
    assert len(await reader.readuntil(b"\n\n")) == 3372
    writer.close()


async def test_a_client_that_stops_reading_loses_scans_and_costs_no_memory(emulator: ScipEmulator) -> None:
    reader, writer = await connect(emulator)
    await ask(reader, writer, b"MD0000108000000")
    tracemalloc.start()
    before_bytes, _ = tracemalloc.get_traced_memory()
    for stamp_ms in range(4000):
        emulator.publish(SCAN, stamp_ms)
    after_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert emulator.counts["dropped"] > 100
    assert after_bytes - before_bytes < 20_000
    writer.close()


async def test_a_second_client_is_turned_away_and_let_in_when_the_first_has_left(emulator: ScipEmulator) -> None:
    reader, writer = await connect(emulator)
    await ask(reader, writer, b"QT")
    port = writer.get_extra_info("peername")[1]
    second, second_writer = await asyncio.open_connection("127.0.0.1", port)
    async with asyncio.timeout(2):
        assert await second.read(1) == b""
    second_writer.close()
    writer.close()
    await writer.wait_closed()
    third, third_writer = await asyncio.open_connection("127.0.0.1", port)
    assert await ask(third, third_writer, b"QT") == b"QT\n00P\n\n"
    third_writer.close()


async def test_a_reboot_ends_the_connection(emulator: ScipEmulator) -> None:
    reader, writer = await connect(emulator)
    assert await ask(reader, writer, b"RB") == b"RB\n01Q\n\n"
    assert await ask(reader, writer, b"RB") == b"RB\n00P\n\n"
    async with asyncio.timeout(2):
        assert await reader.read(1) == b""
    assert emulator.counts["reboot"] == 1
    writer.close()
