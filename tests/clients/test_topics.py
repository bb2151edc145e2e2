"""`wallride topic`: what is on the air, measured and read by somebody who only has the wire."""

import asyncio
import json
import math

import pytest

from tests.clients.speaking_car import options, speaking_car
from wallride.clients import topics
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.topics import KINDS, RateMeter, split_topic


async def told_at_once(*commands):
    """Return what commands say that run beside each other at one car; they measure for seconds."""
    async with speaking_car() as car:
        parsed, said = zip(*(options(car, "topic", *command) for command in commands), strict=True)
        await asyncio.gather(*map(topics.run, parsed))
    return said


async def test_the_list_names_every_topic_with_its_type_and_its_rate_also_as_json():
    wanted = ("list", "--seconds", "2")
    said, in_json = await told_at_once(wanted, (*wanted, "--json"))
    table = {line.split()[0]: line for line in said}
    assert set(table) == set(KINDS)
    assert "sensor_msgs/msg/LaserScan" in table["scan"]
    assert "kB/s" in table["scan"]
    assert float(table["odom"].split()[2]) == pytest.approx(20, abs=4)
    assert table["teleop"].endswith("silent")
    found = {row["topic"]: row for row in json.loads("\n".join(in_json))}
    assert set(found) == set(KINDS)
    assert found["scan"]["type"] == "sensor_msgs/msg/LaserScan"
    assert found["odom"]["rate_hz"] == pytest.approx(20, abs=4)
    assert (found["teleop"]["samples"], found["teleop"]["rate_hz"]) == (0, None)


async def test_echo_says_messages_as_text_and_as_json():
    async with speaking_car() as car:
        parsed, said = options(car, "topic", "echo", "/output", "--once")
        await topics.run(parsed)
        (text,) = said
        assert 'frame_id: "base_link"' in text
        assert "speed: 1" in text
        parsed, said = options(car, "topic", "echo", "wallride/car1/status", "--json", "-n", "2")
        await topics.run(parsed)
    assert [json.loads(line)["output"]["reason"] for line in said] == ["wall", "wall"]


async def test_hz_and_bw_measure_what_comes_also_as_json_lines_with_both_figures():
    figures = {("hz", "Hz"): 20, ("bw", "kB/s"): 20 * 4.384}
    *texts, hz, bw = await told_at_once(
        *((action, "scan", "--count", "2") for action, _ in figures),
        *((action, "scan", "--count", "1", "--json") for action, _ in figures),
    )
    for said, ((_, unit), figure) in zip(texts, figures.items(), strict=True):
        assert len(said) == 2
        rate, its_unit = said[-1].split()[:2]
        assert its_unit == unit
        assert float(rate) == pytest.approx(figure, rel=0.25)
    for (line,) in (hz, bw):
        fields = json.loads(line)
        assert fields["topic"] == "scan"
        assert fields["rate_hz"] == pytest.approx(20, rel=0.25)


async def test_a_topic_that_falls_silent_is_told_and_counts_anew(monkeypatch):
    monkeypatch.setattr(topics, "REPORT_EVERY_S", 0.2)
    monkeypatch.setattr(topics, "SILENT_S", 0.3)
    async with speaking_car() as car, asyncio.timeout(20):
        parsed, said = options(car, "topic", "hz", "scan")
        measuring = asyncio.create_task(topics.run(parsed))
        while not said:
            await asyncio.sleep(0.02)
    while "nothing for" not in said[-1]:
        await asyncio.sleep(0.02)
    measuring.cancel()
    assert " Hz " in said[0]


async def test_a_topic_that_says_nothing_is_explained(monkeypatch):
    monkeypatch.setattr(topics, "FIRST_WITHIN_S", 0.3)
    async with speaking_car() as car:
        parsed, _ = options(car, "topic", "hz", "teleop")
        with pytest.raises(ConnectionProblemError, match="car1 says nothing on teleop: a silent voice has no topic"):
            await topics.run(parsed)


@pytest.mark.parametrize("text", ["scan", "/scan", "wallride/car1/scan", "/wallride/car1/scan"])
def test_a_topic_may_be_written_in_three_ways(text):
    car, topic = split_topic(text, None)
    assert (car, topic) == ("car1" if "car1" in text else None, "scan")


def test_a_wrong_topic_is_answered_with_the_right_ones():
    with pytest.raises(ConnectionProblemError, match="scam: is not a topic; there are scan, odom"):
        split_topic("scam", None)
    with pytest.raises(ConnectionProblemError, match="is a topic of car1, but --car says car2"):
        split_topic("wallride/car1/scan", "car2")


def test_a_meter_counts_gaps_and_bytes():
    meter = RateMeter()
    meter.add(10.0, 100)
    assert math.isnan(meter.rate_hz)
    assert meter.rate_line() == meter.volume_line() == "one sample so far"
    assert meter.silent_after_s > 12.0, "the next one of `map` comes after 5 s"
    for i in range(1, 11):
        meter.add(10 + 0.1 * i, 100)
    assert meter.rate_hz == pytest.approx(10)
    assert meter.bytes_per_s == pytest.approx(1000)
    assert "gaps min 100.0 ms, max 100.0 ms" in meter.rate_line()
    assert "1.00 kB/s" in meter.volume_line()
    assert meter.silent_after_s == topics.SILENT_S
    meter.add(14.0, 100)
    assert meter.silent_after_s == pytest.approx(7.5)
