"""The tape: exact, in order, self-contained, and cheap where it counts."""

import json
import math
import struct
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.observed import HandClock
from wallride.drivers.api import Correction, Drive, MotorState, Scan
from wallride.runtime.arbitration.command import (
    Decision,
    DriveCommand,
    Output,
    Source,
    SpeedLimit,
    Verdict,
    consent,
    refusal,
)
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.recording.decision_codec import TapeError, decode, encode
from wallride.runtime.recording.decision_log import (
    DecisionEvent,
    DecisionLog,
    FollowerEvent,
    OlderEvent,
    SafetyEvent,
    ScanEvent,
    SettingsEvent,
)
from wallride.runtime.settings.tree import Settings

ANY_FLOAT = st.floats(allow_nan=True, allow_infinity=True)
RANGES_M = np.array([1.0, np.nan, 3.0], np.float32)


def bits(number):
    return struct.pack("<d", number)


def same(one, other):
    return bits(one) == bits(other) or (math.isnan(one) and math.isnan(other))


def motor_state(*numbers):
    return MotorState(*numbers, fault="nan", timed_out=False, killed=True)


def play(*entries):
    return decode(encode(list(entries)))


def only_event_of(decision_log, kind):
    (event,) = play(*decision_log.drain())
    assert isinstance(event, kind)
    return event


def make_scan(numbers, sequence):
    return Scan(*numbers, ranges_m=RANGES_M, sequence=sequence)


@given(numbers=st.tuples(*[ANY_FLOAT] * 8))
def test_every_float_survives_bit_for_bit(numbers):
    decision_log = DecisionLog(HandClock())
    decision_log.begin()
    decision_log.add_safety(make_scan(numbers[:6], 7), motor_state(*numbers))
    event = only_event_of(decision_log, SafetyEvent)
    assert event.motor is not None
    read = [getattr(event.motor, field.name) for field in fields(MotorState)][:8]
    assert all(map(same, read, numbers))
    assert event.motor.fault == "nan"  # a text stays a text, whatever it says
    assert event.sequence == 7


@given(numbers=st.tuples(*[ANY_FLOAT] * 6), sequence=st.integers(0, 2**40))
def test_a_scan_comes_back_as_it_was_given_its_ranges(numbers, sequence):
    decision_log = DecisionLog(HandClock())
    decision_log.add_scan(make_scan(numbers, sequence))
    event = only_event_of(decision_log, ScanEvent)
    assert event.beams == 3
    again = event.scan(RANGES_M)
    assert again.sequence == sequence
    assert all(map(same, [getattr(again, field.name) for field in fields(Scan)][:6], numbers))


@given(numbers=st.tuples(*[ANY_FLOAT] * 4))
def test_the_motion_that_a_driver_took_out_of_a_scan_comes_back(numbers):
    decision_log = DecisionLog(HandClock())
    decision_log.add_scan(replace(make_scan([1.0] * 6, 3), correction=Correction(*numbers)))
    found = only_event_of(decision_log, ScanEvent).scan(RANGES_M).correction
    assert found is not None
    assert all(map(same, [getattr(found, field.name) for field in fields(Correction)], numbers))


def test_numbers_of_numpy_are_numbers():
    decision_log = DecisionLog(HandClock())
    decision_log.begin()
    narrow: Any = np.float32  # what a law computes in float32 arrives like this, whatever its annotation says
    guidance = Guidance(Drive(narrow(0.5), np.float64(0.1)), np.float64(math.inf), narrow(math.nan), 0.0, "wall")
    sequence: Any = np.int64(3)
    decision_log.add_follower(make_scan([1.0] * 6, sequence), None, guidance)
    event = only_event_of(decision_log, FollowerEvent)
    assert event.guidance.drive == Drive(0.5, 0.1)
    assert event.guidance.distance_m == math.inf
    assert math.isnan(event.guidance.error_m)
    assert event.motor is None


def output(**more):
    decision = Decision(0.0, None, Source.NAVIGATION, None, "no word from safety", **more)
    return Output(5.0, Drive(0.0, 0.1), decision, delivered=True)


def test_a_step_holds_times_words_and_decision():
    clock = HandClock(5.0)
    decision_log = DecisionLog(clock)
    permit, stop = consent(Source.PERMIT, "yes"), refusal(Source.ESTOP, "e-stop by ann")
    nav = DriveCommand(Source.NAVIGATION, Drive(1.0, 0.2), 4.9, "wall")
    clock.now_s = 4.0
    decision_log.clock()  # belongs to no event
    decision_log.begin()
    clock.now_s = 5.0
    assert decision_log.clock() == 5.0
    clock.now_s = 5.5
    assert decision_log.clock() == 5.5
    decision_log.add_decision(0.02, [stop, permit, nav], output())
    (event,) = play(*decision_log.drain())
    live = (Source.ESTOP, Source.PERMIT, Source.NAVIGATION)
    expected = DecisionEvent(0, (5.0, 5.5), 0.02, live, {Source.ESTOP: stop, Source.PERMIT: permit}, output())
    assert repr(event) == repr(expected)  # as text, because a measure that is not a number is unlike itself


@pytest.mark.parametrize("braked", [True, False])
def test_a_step_holds_what_the_motor_made_of_it_and_older_ones_know_of_no_brake(braked):
    decision_log = DecisionLog(HandClock())
    decision_log.begin()
    decision_log.add_decision(0.02, [], replace(output(), delivered=True, braked=braked))
    message = json.loads(encode(decision_log.drain()))
    assert decode(json.dumps(message).encode())[0].output.braked is braked
    del message["events"][0][-1]
    old = decode(json.dumps(message).encode())[0].output
    assert (old.delivered, old.braked) == (True, False)


def test_an_unchanged_word_is_written_once_per_message_and_again_in_the_next():
    decision_log = DecisionLog(HandClock())
    permit, other = consent(Source.PERMIT, "yes"), consent(Source.PERMIT, "yes")
    for word in (permit, permit, other):
        decision_log.begin()
        decision_log.add_decision(0.02, [word], output())
    entries = decision_log.drain()
    assert [set(event.words) for event in play(*entries)] == [{Source.PERMIT}, set(), {Source.PERMIT}]
    assert set(play(entries[1])[0].words) == {Source.PERMIT}


def test_the_entries_of_older_recordings_leave_no_gap():
    payload = encode([(3, "parts", (None,))]).replace(b'[3,"parts",null]', b'[3,"silence","permit"]')
    assert decode(payload) == [OlderEvent(3)]


def test_settings_come_back_equal():
    decision_log = DecisionLog(HandClock())
    settings = Settings.model_validate({"wall_follow": {"speed_mps": 1.2345678901234567}})
    decision_log.add_settings(settings)
    assert Settings.model_validate(only_event_of(decision_log, SettingsEvent).settings) == settings


def test_what_nobody_drained_is_lost_from_its_oldest_end_and_the_numbers_show_it():
    decision_log = DecisionLog(HandClock(), most=3)
    for _ in range(5):
        decision_log.add_own_parts(None)
    assert [event.number for event in play(*decision_log.drain())] == [2, 3, 4]
    decision_log.add_own_parts(None)
    assert [event.number for event in play(*decision_log.drain())] == [5]


def test_a_tape_of_nothing_keeps_nothing():
    decision_log = DecisionLog(HandClock(3.0), most=0)
    decision_log.begin()
    assert decision_log.clock() == 3.0
    decision_log.add_decision(0.0, [], output())
    assert decision_log.drain() == []


def test_a_step_does_not_keep_what_a_law_made_of_its_scan():
    decision_log = DecisionLog(HandClock())
    decision_log.begin()
    word = SpeedLimit(Source.SAFETY, Verdict(1.0, 1.0, "clear"), 1.0)
    decision_log.add_decision(0.0, [word], output())
    (entry,) = decision_log.drain()
    assert word not in entry[2][2]


@pytest.mark.parametrize(
    "payload", [b"", b"{", b"[]", b"{}", b'{"tape":2}', b'{"tape":1,"columns":{},"motors":[],"events":[]}']
)
def test_what_is_no_tape_is_refused(payload):
    with pytest.raises(TapeError):
        decode(payload)


def test_an_event_of_another_kind_is_refused():
    decision_log = DecisionLog(HandClock())
    decision_log.add_own_parts(None)
    payload = encode(decision_log.drain()).replace(b'"parts"', b'"shout"')
    with pytest.raises(TapeError, match="shout"):
        decode(payload)
