"""The same code decides the same; another setting is found at the first scan that it changes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from tests.sim.replay.recorded import record
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import NO_WINNER, DriveCommand, Source, refusal
from wallride.runtime.recording import channels
from wallride.runtime.recording.decision_log import DecisionEvent
from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.mcap_file import McapFile
from wallride.runtime.wire import topics
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.difference import CLOSE
from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.reenact import _Ranges, events_of, reenact


def decided(log, field="reason"):
    return {fields[field] for _, fields in log.json("decision")}


def alike(log):
    """Return the verdict on a drive that is decided again as it was."""
    verdict = reenact(log)
    assert verdict.first is None
    assert verdict.exact
    return verdict


def test_a_simulated_drive_is_decided_identically(log):
    assert any("slower" in one for one in decided(log)), "a graded limit depends on the clock to the microsecond"
    verdict = alike(log)
    assert verdict.answers == 360
    assert verdict.duration_s == pytest.approx(9.0, abs=0.05)
    assert verdict.decisions >= 360
    assert verdict.notes == []


def take_the_wheel(car):
    word = DriveCommand(Source.TELEOP, Drive(0.7, 0.1), None, "by hand")
    car.queue.put(word, expires_at_s=car.clock() + 0.5)


def stop(car):
    car.queue.put(refusal(Source.ESTOP, "a test"))


def go_on(car):
    car.queue.withdraw(Source.ESTOP)


def set_speed(car):
    follow = car.settings.wall_follow.model_copy(update={"speed_mps": 0.8})
    car.apply(car.settings.model_copy(update={"wall_follow": follow}), ["wall_follow.speed_mps"])


EVENTFUL = (
    (1.0, take_the_wheel), (2.0, stop), (2.4, go_on), (3.0, set_speed), (4.0, lambda car: car.motor.pull()),
    (4.3, lambda car: car.motor.plug()), (5.0, lambda car: car.lidar.pull()), (5.4, lambda car: car.lidar.plug()),
)  # fmt: skip


def test_people_settings_and_cables_are_replayed_too(tmp_path):
    path = tmp_path / "eventful.mcap"
    record(path, seconds=6.0, events=EVENTFUL)
    log = read_log(path)
    assert {"teleop", "e-stop", "navigation", NO_WINNER} <= decided(log, "winner")
    assert alike(log).decisions > 240


def test_a_way_between_the_borders_that_is_kept_over_stops_and_lost_devices_is_replayed(tmp_path):
    path = tmp_path / "corridor.mcap"
    record(path, seconds=6.0, events=EVENTFUL, sections={"wall_follow": {"method": "corridor", "speed_mps": 1.5}})
    log = read_log(path)
    assert "between the borders" in decided(log)
    alike(log)


def test_the_ramp_after_a_brake_of_the_motors_own_is_replayed(tmp_path):
    path = tmp_path / "braked.mcap"
    events = ((2.0, lambda car: car.motor.latch_fault("a test")), (2.04, lambda car: car.motor.clear_fault()))
    record(path, seconds=3.0, events=events)
    log = read_log(path)
    braked = [event.output for event in events_of(log) if isinstance(event, DecisionEvent) and event.output.braked]
    assert braked
    assert all(output.drive.speed_mps for output in braked)
    alike(log)


def test_another_gain_is_found_at_the_first_scan_that_it_changes(log):
    verdict = reenact(log, ["safety.graded_share=0.3"])
    first = verdict.first
    assert first is not None
    assert verdict.differing > 10
    assert first.scan > 100, "the long way is free: only near the wall does the gain matter"
    assert first.what == "winner"
    assert (first.recorded, first.replayed) == (Source.NAVIGATION, Source.SAFETY)
    assert first.sentence().startswith(
        f"scan {first.scan}, {first.time_s:.3f} s: winner: recorded navigation, replayed"
    )


def test_a_setting_that_changes_nothing_is_no_difference(log):
    assert reenact(log, ["wall_follow.speed_mps=2.0", "log.level=ERROR"]).first is None


def test_a_tape_that_begins_in_the_middle_is_compared_loosely_and_says_so(tmp_path):
    path = tmp_path / "middle.mcap"
    record(path, world="corridor", seconds=9.0, forgets=400)
    verdict = reenact(read_log(path))
    assert not verdict.exact
    assert "begins while the car was running" in verdict.notes[0]
    assert str(CLOSE) in verdict.notes[0]
    assert verdict.first is None
    assert verdict.decisions > 200


def test_scans_that_are_not_in_the_file_are_counted(log, tmp_path):
    path = rewritten(log, tmp_path, leave_out=lambda message: message.topic == "scan" and message.sequence == 200)
    verdict = reenact(read_log(path))
    assert "1 scans that the laws saw are not in the recording" in verdict.notes[-1]
    assert verdict.scans == 359


def test_a_hole_in_the_tape_is_said_and_not_taken_for_a_difference(log, tmp_path):
    tapes = log.of(channels.TAPE)
    lost = tapes[len(tapes) // 3]
    verdict = reenact(read_log(rewritten(log, tmp_path, leave_out=lambda message: message == lost)))
    assert not verdict.exact
    assert "64 events are missing after scan" in verdict.notes[0]
    assert verdict.first is None or verdict.first.time_s > 5


def test_a_recording_without_a_tape_is_refused_with_what_it_is_good_for(log, tmp_path):
    path = rewritten(log, tmp_path, leave_out=lambda message: message.topic == channels.TAPE)
    with pytest.raises(RecordingError, match=r"has no decision log.*can be published and reported"):
        reenact(read_log(path))


def test_a_tape_of_another_format_is_refused_with_the_remedy(log, tmp_path):
    path = rewritten(log, tmp_path, change=lambda payload: payload.replace(b'"tape":1', b'"tape":9', 1))
    with pytest.raises(RecordingError, match="replay it with the version that recorded it"):
        reenact(read_log(path))


def rewritten(log, folder, *, leave_out=lambda message: False, change=lambda payload: payload):
    """Return a copy without some messages, or with another decision log."""
    copy = folder / "copy.mcap"
    file = McapFile(copy, Disk(), {"car": "car1"}, "wallride")
    for message in log.messages:
        if not leave_out(message):
            payload = change(message.payload) if message.topic == channels.TAPE else message.payload
            schema = message.schema or channels.STRING
            payload = payload if message.schema else channels.text(payload)
            file.add(channels.RecordMessage(message.topic, schema, message.stamp_ns, payload, message.sequence))
    file.close()
    return copy


def test_a_converted_copy_in_which_scans_have_no_numbers_is_refused(log):
    scans = log.of(topics.SCAN)
    copy: Any = SimpleNamespace(of=lambda _topic: [replace(scan, sequence=0) for scan in scans])
    with pytest.raises(RecordingError, match="another program converted: take the original"):
        _Ranges(copy)
