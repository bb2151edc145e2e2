"""Telemetry: off the hot path, newest values only, every consumer the same bytes."""

import asyncio
import json
import math
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from tests.own_laws import EASY
from tests.runtime.observed import GUIDANCE, HandClock, check_told, make_observed, output_of, scan_at, speak
from tests.runtime.ros.samples import ros_store
from tests.runtime.telemetry.test_sinks import Ear
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import Source, Verdict
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.ros.graph import SCAN_BY_BEAM, TF_ODOM
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.tasks.telemetry import BURST_PERIOD_S, Telemetry
from wallride.runtime.telemetry.sinks import ZenohSink
from wallride.runtime.telemetry.topic_writers import TopicWriters
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import Command, Input, Press

EPOCH_NS = 1_790_000_000_000_000_123
STORE = ros_store()


class Keeper:
    """A sink that keeps what it takes."""

    def __init__(self, *topics):
        self.topics = set(topics)
        self.kept = []

    def claim(self, topic, at_s, *, urgent=False):
        return not self.topics or topic in self.topics

    def take(self, topic, schema, stamp_s, payload):
        self.kept.append((topic, schema, stamp_s, payload))

    def of(self, topic):
        return [payload for name, _, _, payload in self.kept if name == topic]


class Rig:
    def __init__(self, *sinks, **observed):
        self.clock = HandClock()
        self.observed = replace(make_observed(self.clock), **observed)
        self.sinks = sinks or (Keeper(),)
        wall_clock = WallClock(lambda: 0.0, lambda: EPOCH_NS)
        self.telemetry = Telemetry(
            self.observed, CarSettings(), self.sinks, wall_clock=wall_clock, side=lambda: "left", ball_m=lambda: None
        )

    def drive_once(self, guidance=GUIDANCE, *, safety=None, **output):
        """Let one scan go all the way to the motor."""
        self.clock.now_s += 0.025
        scan = scan_at(self.clock.now_s)
        self.telemetry.on_scan(scan)
        speak(self.observed, safety=safety(scan) if safety is not None else None)
        self.telemetry.on_guidance(scan, guidance)
        self.clock.now_s += 0.004
        self.telemetry.on_output(output_of(self.observed, **output))

    async def written(self, turns=60):
        """Let the task write what it has."""
        task = asyncio.create_task(self.telemetry.run())
        for _ in range(turns):
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.wait([task])
        return self.sinks[0]

    async def told(self, topic):
        """Return the one message that was written on a topic."""
        (payload,) = (await self.written()).of(topic)
        return decoded(payload, topic)


def decoded(payload, topic):
    return STORE.deserialize_cdr(payload, TYPES[topic])


async def test_one_scan_brings_every_topic_that_has_something_to_say():
    rig = Rig()
    rig.drive_once()
    kept = await rig.written()
    native = [one for one in kept.kept if one[0] not in {TF_ODOM, SCAN_BY_BEAM}]  # which only the sink for ROS 2 claims
    check_told({topic for topic, *_ in native})
    for topic, schema, stamp_s, payload in native:
        assert schema == TYPES.get(topic, "")
        assert stamp_s == pytest.approx(rig.clock.now_s, abs=0.03)
        if schema:
            decoded(payload, topic)
        else:
            json.loads(payload)


@pytest.mark.parametrize("own", [False, True])
async def test_the_footprint_has_the_view_of_perception_also_under_an_own_law(law_file, own):
    settings = load_settings(None, [f"safety.method={law_file(EASY)}"] if own else [])
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    rig = Rig(Keeper(topics.FOOTPRINT), view=lambda: laws.perception.newest_view)
    rig.drive_once(safety=lambda scan: laws.look(scan, rig.observed.motor.state))
    assert "ignored" in {marker.ns for marker in (await rig.told(topics.FOOTPRINT)).markers}


async def test_stamps_are_those_of_the_measurement_since_1970_with_exact_differences():
    rig = Rig(Keeper(topics.SCAN))
    stamps_ns, measured_s = [], []
    for _ in range(3):
        rig.clock.now_s += BURST_PERIOD_S
        rig.drive_once()
        measured_s.append(rig.clock.now_s - 0.004)
        header = decoded((await rig.written()).of(topics.SCAN)[-1], topics.SCAN).header
        stamps_ns.append(header.stamp.sec * 10**9 + header.stamp.nanosec)
    assert stamps_ns == [EPOCH_NS + round(stamp_s * 1e9) for stamp_s in measured_s]


async def test_nothing_is_written_before_the_motor_has_its_command():
    rig = Rig()
    rig.telemetry.on_scan(scan_at(100.0))
    rig.telemetry.on_guidance(scan_at(100.0), GUIDANCE)
    assert (await rig.written()).kept == []
    speak(rig.observed)
    rig.telemetry.on_output(output_of(rig.observed))
    assert rig.sinks[0].of(topics.SCAN) == []
    assert len((await rig.written()).of(topics.SCAN)) == 1


async def test_a_turn_of_the_loop_writes_for_a_fifth_of_a_millisecond_at_most(monkeypatch):
    rig = Rig()
    rig.drive_once()
    write, writes = TopicWriters.write, []

    def write_slowly(writers, topic):
        message = write(writers, topic)
        if message is not None:
            rig.clock.now_s += 0.00015
            writes.append(topic)
        return message

    monkeypatch.setattr(TopicWriters, "write", write_slowly)
    task = asyncio.create_task(rig.telemetry.run())
    sizes = []
    for _ in range(30):
        await asyncio.sleep(0)
        sizes.append(len(writes))
    task.cancel()
    assert sizes[-1] > 10
    assert max(np.diff(sizes)) == 2
    assert len(rig.sinks[0].kept) > 10


async def test_what_was_not_written_in_time_is_replaced_by_the_newer_or_told_too():
    rig = Rig()
    for _ in range(5):
        rig.drive_once()
    kept = await rig.written()
    assert len(kept.of(topics.SCAN)) == len(kept.of(topics.STATUS)) == 1
    assert len(kept.of(topics.OUTPUT)) == len(kept.of(topics.DISTANCE_ERROR)) == 5
    assert decoded(kept.of(topics.SCAN)[0], topics.SCAN).scan_time == pytest.approx(0.029)


async def test_what_comes_while_a_burst_is_written_is_not_written_twice(monkeypatch):
    monkeypatch.setattr("wallride.runtime.tasks.telemetry.TURN_S", -1.0)  # one message each turn
    rig = Rig()
    rig.drive_once()
    task = asyncio.create_task(rig.telemetry.run())
    for turn in range(120):
        await asyncio.sleep(0)
        if turn == 3:
            rig.clock.now_s += BURST_PERIOD_S
            rig.drive_once()
    task.cancel()
    kept = rig.sinks[0]
    assert [len(kept.of(topic)) for topic in (topics.SCAN, topics.ODOM)] == [1, 1]
    assert len(kept.of(topics.OUTPUT)) == 2


async def test_what_comes_during_a_burst_and_is_too_early_for_a_topic_waits_for_the_next_burst(monkeypatch):
    class Early(Keeper):
        def claim(self, topic, at_s, *, urgent=False):
            return topic != topics.SCAN or at_s >= due_s

    rig = Rig(Early())
    rig.drive_once()
    due_s = rig.clock.now_s + 0.5
    rig.clock.now_s += 1.0
    task = asyncio.create_task(rig.telemetry.run())
    monkeypatch.setattr("wallride.runtime.tasks.telemetry.TURN_S", -1.0)
    rig.clock.now_s = due_s - 0.1
    for turn in range(60):
        await asyncio.sleep(0)
        if turn == 3:
            rig.telemetry.on_scan(scan_at(rig.clock.now_s))
            speak(rig.observed)
            rig.telemetry.on_guidance(scan_at(rig.clock.now_s), GUIDANCE)
    assert rig.sinks[0].of(topics.SCAN) == []
    rig.clock.now_s = due_s
    rig.telemetry._woken.set()
    for _ in range(60):
        await asyncio.sleep(0)
    task.cancel()
    assert len(rig.sinks[0].of(topics.SCAN)) == 1


async def test_they_leave_in_bursts_but_a_change_of_mind_at_once():
    rig = Rig()
    task = asyncio.create_task(rig.telemetry.run())

    async def told(**output):
        before = len(rig.sinks[0].kept)
        rig.drive_once(**output)
        for _ in range(60):
            await asyncio.sleep(0)
        return [topic for topic, *_ in rig.sinks[0].kept[before:]]

    assert topics.OUTPUT in await told()
    assert await told() == []
    assert (await told()).count(topics.OUTPUT) == 2
    assert await told() == []
    changed = await told(reason="boxed in")
    assert changed[0] == topics.DECISION
    assert changed.count(topics.OUTPUT) == 2
    assert await told(reason="wall ahead"), "another one right after it"
    task.cancel()


async def test_an_unwanted_message_is_not_even_written(monkeypatch):
    rig = Rig(Keeper(topics.ODOM))
    wrote = []
    write = TopicWriters.write

    def watched(writers, topic):
        wrote.append(topic)
        return write(writers, topic)

    monkeypatch.setattr(TopicWriters, "write", watched)
    rig.drive_once()
    await rig.written()
    assert wrote == [topics.ODOM]


async def test_all_sinks_get_the_same_bytes_of_one_writing():
    one, two = Keeper(), Keeper(topics.SCAN)
    rig = Rig(one, two)
    rig.drive_once()
    await rig.written()
    assert two.kept == [kept for kept in one.kept if kept[0] == topics.SCAN]
    assert two.of(topics.SCAN)[0] is one.of(topics.SCAN)[0]


async def test_every_change_of_mind_is_told_even_between_two_turns_and_beyond_the_rate():
    ear = Ear(topics.DECISION)
    rig = Rig(ZenohSink(ear, "car1", RatesHz(decision=0.001)))
    reasons = ["wall", "wall ahead", "wall ahead", "wall", "boxed in"]
    for reason in reasons:
        rig.drive_once(reason=reason)
    await rig.written()
    assert [json.loads(payload)["reason"] for _, payload, _ in ear.heard] == ["wall", "wall ahead", "wall", "boxed in"]


async def test_safety_says_what_it_allows_of_the_wish_and_nothing_when_nobody_drives():
    rig = Rig(Keeper(topics.SAFETY))
    speak(rig.observed, speed_mps=2.0, safety=Verdict(0.5, math.inf, "slower", 1.0))
    rig.telemetry.on_output(output_of(rig.observed, speed_mps=0.5, winner=Source.SAFETY, reason="slower", measure=1.0))
    assert (await rig.told(topics.SAFETY)).drive.speed == 0.5
    speak(rig.observed, speed_mps=-1.0, safety=Verdict(math.inf, math.inf, "clear"))
    rig.telemetry.on_output(output_of(rig.observed, speed_mps=-1.0))
    payload = (await rig.written()).of(topics.SAFETY)[-1]
    assert decoded(payload, topics.SAFETY).drive.speed == -1.0
    rig.observed.queue.withdraw(Source.NAVIGATION)
    rig.telemetry.on_output(output_of(rig.observed))
    assert len((await rig.written()).of(topics.SAFETY)) == 2


async def test_a_silent_voice_publishes_nothing():
    rig = Rig(Keeper(topics.NAVIGATION, topics.TELEOP))
    rig.drive_once()
    kept = await rig.written()
    assert decoded(kept.of(topics.NAVIGATION)[0], topics.NAVIGATION).drive.steering_angle == pytest.approx(0.1)
    assert kept.of(topics.TELEOP) == []


async def test_what_an_operator_holds_is_published_as_a_pad():
    command = Command(1, 1, 1, 1, Press.MANUAL, Input.PAGE, speed_mps=2.0)
    rig = Rig(Keeper(topics.JOY), held=lambda: command)
    rig.drive_once()
    pad = await rig.told(topics.JOY)
    assert (list(pad.axes), list(pad.buttons)) == ([0, 0.5, 1, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0])


async def test_latency_and_score_are_kept_for_the_status():
    rig = Rig()
    rig.observed.motor.send(Drive(1.0, 0.0))
    for _ in range(10):
        rig.drive_once()
    status = rig.telemetry.status()
    assert status["scan_to_motor_ms"]["p50"] == pytest.approx(3.0, abs=0.01), "received 1 ms after its stamp"
    assert status["distance_error"]["mean_abs_m"] == 0.125
    assert status["scans"] == 10


async def test_a_car_that_stands_neither_improves_nor_worsens_its_score():
    rig = Rig()
    rig.drive_once()
    assert math.isnan(rig.telemetry.status()["distance_error"]["mean_abs_m"]), "it has not moved yet"
    rig.observed.motor.send(Drive(1.0, 0.0))
    rig.drive_once()
    rig.observed.motor.send(Drive(0.0, 0.0))
    for _ in range(5):
        rig.drive_once(guidance=replace(GUIDANCE, error_m=0.9))
    rig.observed.motor.present = False  # an unknown speed
    rig.drive_once(guidance=replace(GUIDANCE, error_m=0.9))
    assert rig.telemetry.status()["distance_error"] == {"mean_abs_m": 0.125, "rms_m": 0.125}


async def test_an_inertial_measurement_goes_out_as_it_came():
    rig = Rig(Keeper(topics.IMU))
    rig.telemetry.on_imu(100.0, (0.0, 0.0, 0.5), (0.0, 0.0, 9.81))
    rig.drive_once()
    assert (await rig.told(topics.IMU)).angular_velocity.z == 0.5


async def test_a_lost_motor_has_no_odometry_and_the_rest_goes_on():
    rig = Rig()
    rig.observed.motor.present = False
    rig.drive_once()
    kept = await rig.written()
    assert not {topics.ODOM, topics.TF, topics.MOTOR, topics.BATTERY} & {topic for topic, *_ in kept.kept}
    (payload,) = kept.of(topics.DIAGNOSTICS)
    assert [report.level for report in decoded(payload, topics.DIAGNOSTICS).status] == [0, 2, 0, 0]


async def test_forgotten_changes_are_the_oldest():
    rig = Rig(Keeper(topics.DECISION))
    for number, _ in zip(count(), range(100), strict=False):
        rig.drive_once(reason=f"reason {number}")
    told = [json.loads(payload)["reason"] for payload in (await rig.written(200)).of(topics.DECISION)]
    assert told[-1] == "reason 99"
    assert len(told) <= 33
