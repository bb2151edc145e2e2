"""A recording is enough to drive again: the same laws, given what is in the file, decide the same."""

import math
from itertools import pairwise
from typing import Any

from tests.runtime.recording.drives import LIMITS, Drive, driven
from tests.runtime.recording.reading import events, ranges_by_sequence
from wallride.runtime.arbitration.command import DriveCommand, QueueEntry, Source, SpeedLimit, arbitrate
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.live_stack import REQUIRED
from wallride.runtime.recording.decision_log import DecisionEvent, FollowerEvent, SafetyEvent, ScanEvent, SettingsEvent
from wallride.runtime.settings.driven_car import driven_car
from wallride.runtime.settings.tree import Settings
from wallride.sim.virtual.devices import ranges_between_walls


class RecordedClock:
    """Answers what was answered then."""

    def __init__(self):
        self.times_s = []

    def __call__(self):
        return self.times_s.pop(0)


def replayed(content):
    """Yield what is decided now beside what was decided then, event by event."""
    decision_log, ranges_m, clock = events(content), ranges_by_sequence(content), RecordedClock()
    limiter, settings, scans = Limiter(LIMITS), Settings(), {}
    laws: Any = None
    words: dict[Source, QueueEntry] = {}
    for event in decision_log:
        match event:
            case SettingsEvent():
                settings = Settings.model_validate(event.settings)
                laws = LiveLaws(settings.wall_follow, settings.safety, driven_car(settings), clock)
            case ScanEvent():
                scans[event.sequence] = event.scan(ranges_m[event.sequence])
            case SafetyEvent():
                clock.times_s, scan = list(event.times_s), scans[event.sequence]
                words[Source.SAFETY] = SpeedLimit(Source.SAFETY, laws.look(scan, event.motor), scan.stamp_s)
            case FollowerEvent():
                clock.times_s, scan = list(event.times_s), scans[event.sequence]
                guidance = laws.follow(scan, event.motor)
                words[Source.NAVIGATION] = DriveCommand(
                    Source.NAVIGATION, guidance.drive, scan.stamp_s, guidance.reason
                )
                yield repr(guidance), repr(event.guidance)
            case DecisionEvent():
                words |= event.words
                clock.times_s = list(event.times_s[2:])  # the mux's own, and that of the commands' expiry
                decision, _ = arbitrate([words[source] for source in event.live], REQUIRED, settings.effective_order())
                drive = limiter.limit(decision.speed_mps, decision.steering_rad, event.elapsed_s, decision.brake_mps2)
                yield repr((decision, drive)), repr((event.output.decision, event.output.drive))
            case _:
                pass


async def test_a_recording_from_the_start_decides_the_same_to_the_last_bit(tmp_path):
    drive = await driven(tmp_path, 3, start="always")
    await drive.go(1.5, ranges_m=ranges_between_walls(0.9, 1.1, 1.2))
    drive.recorder.close()
    drive.recorder.finish()
    (path,) = tmp_path.glob("*.mcap")
    content = path.read_bytes()
    pairs = list(replayed(content))
    assert len(pairs) == 2 * len(drive.scans)
    assert len({then for _, then in pairs}) > 100
    for now, then in pairs:
        assert now == then
    numbers = [event.number for event in events(content)]
    assert numbers[0] == 0
    assert all(later - earlier == 1 for earlier, later in pairwise(numbers))


async def test_every_scan_is_recorded_float_by_float_whatever_telemetry_does(tmp_path):
    drive = Drive(tmp_path, start="always")
    for _ in range(40):
        drive.scan()  # in one burst: telemetry would show the newest only
    drive.recorder.turn()
    drive.recorder.finish()
    (path,) = tmp_path.glob("*.mcap")
    recorded = ranges_by_sequence(path.read_bytes())
    assert sorted(recorded) == list(range(40))
    for scan in drive.scans:
        assert recorded[scan.sequence].tobytes() == scan.ranges_m.tobytes()
    assert any(math.isnan(value) for value in recorded[0])
