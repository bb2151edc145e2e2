"""Stories of the whole runtime in virtual time: the unmodified tasks, in-memory devices, exact seconds."""

import asyncio
import functools
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.system.timed_drive import drive_for
from tests.tiers import slow
from wallride.clients.decoding import decode
from wallride.drivers.api import Drive
from wallride.runtime.app import Car
from wallride.runtime.arbitration.command import DriveCommand, Source
from wallride.runtime.arbitration.permit import NOT_GRANTED
from wallride.runtime.settings.tree import Settings
from wallride.sim.lab import stories
from wallride.sim.lab.stories import STORIES, tell
from wallride.sim.virtual.devices import MemoryBus, MemoryLidar, MemoryMotor, ranges_between_walls
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.obstacles import ConstantMotion, person

CORRIDOR = ranges_between_walls(1.0, 1.0)
LONG = "laps of the loop", "dead end"
BLOCKED = ranges_between_walls(1.0, 1.0, ahead_m=0.8)


class Story:
    """A car between two walls, and a person who does things to it at certain times."""

    def __init__(self, **sections):
        # The scans here do not move with the car, which only the report's laws do not mind.
        report = {"method": "report"}
        sections = {
            "battery": {"settle_s": 0},
            "operator": {"permit": "always"},
            "wall_follow": {},
            "safety": {},
            **sections,
        }
        sections |= {name: report | sections[name] for name in ("wall_follow", "safety")}
        self.settings = Settings.model_validate(sections)
        self.scans: np.ndarray | None = CORRIDOR

    def run(self, seconds, *events):
        """Drive for so long; events are (time, function of this story)."""

        async def main():
            loop = asyncio.get_running_loop()
            self.now = loop.time
            self.motor = MemoryMotor(loop.time)
            self.lidar = MemoryLidar(lambda _: self.scans, loop.time)
            self.ear = MemoryBus(loop.time)
            self.car = Car(self.settings, self.lidar, self.motor, self.ear, loop.time)
            await drive_for(seconds, self.car, self, events)

        run_virtual(main())
        return self

    def speed_at(self, at_s):
        return [drive for when_s, drive in self.motor.wire if when_s <= at_s][-1].speed_mps

    def first_brake_after(self, at_s):
        return next(when_s for when_s, drive in self.motor.wire if when_s > at_s and drive.speed_mps == 0)


def silence(story):
    story.scans = None


def wall_ahead(story):
    story.scans = BLOCKED


def clear(story):
    story.scans = CORRIDOR


def unplug(story):
    story.motor.present = False


def plug(story):
    story.motor.present = True


def test_it_sets_off_and_drives_at_the_asked_speed():
    story = Story().run(3.0)
    assert story.speed_at(2.9) == 1.0
    assert story.car.mux.seconds_by_winner["navigation"] > 2.5


def test_it_does_not_move_before_the_first_scan():
    story = Story()
    story.scans = None
    story.run(2.0, (1.0, clear))
    assert all(drive.speed_mps == 0 for when_s, drive in story.motor.wire if when_s < 0.99)
    assert story.speed_at(1.9) == 1.0


def test_the_last_word_is_a_brake():
    story = Story().run(3.0)
    assert story.motor.wire[-1][1].speed_mps == 0
    stopped = [when_s for when_s, drive in story.motor.wire if drive.speed_mps == 0 and when_s > 2.999]
    assert stopped[0] - 3.0 < 0.001


@pytest.mark.parametrize("at_s", [2.0, 2.004, 2.011, 2.017, 2.024])
def test_a_silent_lidar_stops_the_car_within_a_quarter_second_of_the_last_scan(at_s):
    story = Story().run(2.5, (at_s, silence))
    last_scan_s = int(at_s / 0.025) * 0.025
    assert story.first_brake_after(2.0) - last_scan_s < 0.18
    assert story.car.mux.output.decision.reason in {"no word from teleop or navigation", "no word from safety"}


def test_it_ticks_on_in_silence():
    story = Story().run(4.0, (2.0, silence))
    times = [when_s for when_s, _ in story.motor.wire if 2.5 < when_s < 4.0]
    # A tick beside another timer's may come half a millisecond early, and the next one that much later.
    assert max(after - before for before, after in pairwise(times)) < 0.0206


def test_a_frozen_scan_delivered_late_does_not_drive():
    def late(story):
        story.lidar.late_s = 0.2

    story = Story().run(4.0, (2.0, late))
    assert story.speed_at(3.9) == 0


def test_safety_stops_before_the_scan_that_shows_the_obstacle_can_drive():
    story = Story().run(4.0, (2.0, wall_ahead))
    first_blocked_s = 2.0 + 0.025
    assert story.first_brake_after(2.0) <= first_blocked_s + 0.0001
    assert all(drive.speed_mps == 0 for when_s, drive in story.motor.wire if when_s > first_blocked_s)
    assert story.car.mux.output.decision.winner is Source.SAFETY


def test_the_wheels_are_still_steered_while_safety_brakes():
    story = Story(wall_follow={"desired_distance_m": 0.8}).run(3.0, (2.0, wall_ahead))
    decision = story.car.mux.output.decision
    assert decision.speed_mps == 0
    assert decision.steering_rad is not None


def test_without_a_permit_nothing_moves():
    story = Story(operator={"permit": "required"}).run(3.0)
    assert {drive.speed_mps for _, drive in story.motor.wire} == {0}
    assert story.car.mux.output.decision.reason == NOT_GRANTED


def test_a_permit_lasts_only_so_long_as_it_is_renewed():
    def grant(story):
        story.car.permit.grant(until_s=story.now() + 1.0)

    story = Story(operator={"permit": "required"}).run(5.0, (1.0, grant), (1.8, grant))
    assert story.speed_at(0.99) == 0
    assert story.speed_at(2.5) == 1.0
    assert story.first_brake_after(2.5) < 2.8 + 0.021
    assert story.speed_at(4.9) == 0


@pytest.mark.parametrize(("permit", "speed_afterwards"), [("always", 1.0), ("required", 0.0)])
def test_after_an_unplugged_motor_it_resumes_only_as_the_settings_allow(permit, speed_afterwards):
    def grant(story):
        story.car.permit.grant(until_s=100.0)

    story = Story(operator={"permit": permit}).run(6.0, (0.5, grant), (2.0, unplug), (3.0, plug))
    assert story.speed_at(1.9) == 1.0
    back = next(drive for when_s, drive in story.motor.wire if when_s > 3.0)
    assert abs(back.speed_mps) <= 0.2 + 1e-9, "a motor that comes back is not met by full speed"
    assert story.speed_at(5.9) == speed_afterwards


def test_a_motor_fault_is_latched():
    story = Story(operator={"permit": "required"}).run(6.0, (2.0, lambda story: story.motor.inject_fault("DRV")))
    assert story.speed_at(5.9) == 0
    assert story.car.mux.output.decision.winner is Source.ESTOP


def test_without_an_operator_a_fault_that_is_gone_is_tried_again():
    story = Story().run(8.0, (2.0, lambda story: story.motor.inject_fault("DRV")))
    assert story.speed_at(2.2) == 0
    assert story.speed_at(3.9) == 0
    assert story.speed_at(7.9) == 1.0


def test_a_lasting_fault_keeps_the_car_standing():
    story = Story().run(12.0, (2.0, lambda story: story.motor.inject_fault("DRV", lasting=True)))
    assert all(drive.speed_mps == 0 for when_s, drive in story.motor.wire if when_s > 2.1)


def push_stick(story):
    story.car.queue.put(DriveCommand(Source.TELEOP, Drive(0.5, 0.0), None, "stick"), expires_at_s=story.now() + 0.2)


@pytest.mark.parametrize(("bound", "speed"), [(False, 0.5), (True, 0.0)])
def test_the_stick_overrides_safety_unless_bound(bound, speed):
    pushes = [(3.0 + n * 0.05, push_stick) for n in range(40)]
    story = Story(safety={"binds_teleop": bound}).run(5.5, (2.0, wall_ahead), *pushes)
    assert story.speed_at(4.5) == speed
    assert story.speed_at(5.4) == 0, "the stick is silent again, and the wall is still there"


def test_a_task_that_dies_takes_the_car_to_a_stop():
    class BugError(Exception):
        pass

    def sabotage(story):
        def look(*_):
            raise BugError

        story.car.laws.guard.look = look

    story = Story()
    with pytest.raises(ExceptionGroup) as caught:
        story.run(5.0, (2.0, sabotage))
    assert caught.group_contains(BugError)
    assert story.motor.wire[-1][1].speed_mps == 0
    assert story.first_brake_after(2.0) < 2.05
    assert not [drive for when_s, drive in story.motor.wire if when_s > 2.05 and drive.speed_mps]


def test_the_distance_error_is_published_and_scored():
    story = Story(wall_follow={"desired_distance_m": 0.9}).run(3.0)
    errors = [payload for key, payload in story.ear.heard if key == "wallride/car1/distance_error"]
    assert len(errors) > 100
    assert decode("distance_error", errors[-1])["data"] == pytest.approx(0.1, abs=0.002)
    assert story.car.telemetry.journey.score.mean_abs_m == pytest.approx(0.1, abs=0.002)


def test_a_motor_that_takes_brakes_and_goes_on_is_told():
    def swallow(story):
        setattr(story.motor, "send", lambda _drive: True)  # noqa: B010 - a method

    story = Story().run(6.0, (2.0, swallow), (2.1, wall_ahead))
    assert story.motor.state.speed_mps == 1.0
    status = next(payload for key, payload in reversed(story.ear.heard) if key == "wallride/car1/status")
    assert b"the wheels go on at 1.0 m/s although the car brakes" in status


def test_the_status_names_winner_reason_and_voices():
    story = Story().run(3.0)
    status = decode("status", next(text for key, text in reversed(story.ear.heard) if key == "wallride/car1/status"))
    assert (status["output"]["winner"], status["output"]["reason"]) == ("navigation", "wall")
    assert status["voices"]["safety"]["age_s"] < 0.03
    assert status["lidar"]["link"] == "ready"


def test_the_status_says_what_is_wrong_with_the_window():
    dirt = "12 beams around -95 deg are dirty: clean the window"

    def soil(story):
        story.car.laws.guard.perception.health.words = (dirt,)

    story = Story(wall_follow={"method": "ball"}, safety={"method": "swept"})
    story.scans = None  # nothing is learnt that would unsay it
    story.run(2.0, (1.0, soil))
    status = next(payload for key, payload in reversed(story.ear.heard) if key == "wallride/car1/status")
    assert dirt.encode() in status


told_of = functools.cache(lambda name: tell(STORIES[name]))


# From here on: a simulated world before the lidar and a simulated car behind the motor, and the default laws.


@pytest.mark.parametrize("name", [*(name for name in STORIES if name not in LONG), *slow(*LONG)])
def test_with_the_default_laws_the_story_ends_as_it_should(name):
    told = told_of(name)
    assert [what for what, held in STORIES[name].says(told) if not held] == []


def test_laps_are_driven_at_the_wall_and_repeat_to_the_last_bit():
    story = replace(STORIES["laps of the loop"], lasts_s=4.5)
    first, second = tell(story), tell(story)
    assert first.pose == second.pose
    assert first.wire == second.wire
    assert first.pose != tell(story, seed=7).pose, "another noise, another drive"
    off_m = [abs(wall_m - 1.0) for wall_m in first.wall_m[80:]]
    assert sum(off_m) / len(off_m) < 0.06, "the corners are rounded"


def test_from_a_pulled_lidar_cable_on_not_one_command_moves_the_car():
    told = told_of("lidar cable pulled and back")
    pulled_s, back_s = 4.0, 7.0
    after = [drive for at_s, drive in told.wire if pulled_s + 0.15 < at_s < back_s]
    assert after
    assert {drive.speed_mps for drive in after} == {0.0}
    assert {drive.brake_mps2 for drive in after} == {math.inf}, "nobody sees: all the brake there is"


def test_with_a_permit_a_pulled_cable_is_the_end_of_it():
    """After the cable is back the operator has to permit again; nobody does."""

    def permit(play):
        play.car.permit.grant(until_s=100.0)

    story = STORIES["lidar cable pulled and back"]
    told = tell(replace(story, permit="required", events=((0.5, permit), *story.events)))
    assert told.went_s(0.0) < 1.5
    assert told.went_s(7.0) == math.inf
    assert told.reasons[-5] == "the lidar was lost; permit again"


def test_a_motor_that_comes_back_is_told_no_more_than_it_turns():
    told = told_of("motor controller lost and back")
    first = next(drive for at_s, drive in told.wire if at_s >= 7.0)
    assert abs(first.speed_mps) < 0.2
    assert not [at_s for at_s, _ in told.wire if 4.0 < at_s < 6.99]


def test_a_person_is_braked_for_before_the_scan_that_shows_him_can_drive():
    """One who stands there suddenly, just where stopping still helps: no command to move from that scan on."""
    appears_s = 3.0
    there = person(6.5, 0.0, ConstantMotion(0.0, 0.0, appears_s))
    told = tell(replace(STORIES["a person crosses"], obstacles=(there,), lasts_s=5.0, speed_mps=2.0))
    assert told.contact_mps is None
    assert told.speed_at(appears_s) > 1.8
    assert {drive.speed_mps for at_s, drive in told.wire if at_s > appears_s + 0.024} == {0.0}


def test_a_dirty_window_is_said_and_a_clean_one_is_not():
    clean = tell(replace(STORIES["dirty window from the first scan on"], lidar=None, lasts_s=5.0))
    assert clean.window == ()
    beams = LidarSettings(noise_std_m=0.02, outlier_share=0.02, dirty_sectors=((38.0, 43.5, 0.4),))
    wide = tell(replace(STORIES["dirty window from the first scan on"], lidar=beams, lasts_s=8.0, speed_mps=2.0))
    assert any("are dirty: clean the window" in words for words in wide.window)
    assert max(wide.speed_mps[-40:]) < 1.1, "five degrees ahead are too wide to be ignored: slowly on"


def test_the_dead_end_is_the_end_without_backing_out():
    told = tell(replace(STORIES["dead end"], lasts_s=8.0, speed_mps=2.0))
    assert min(told.speed_mps) < -0.2
    waits = stories.tell(replace(STORIES["dead end"], lasts_s=8.0, speed_mps=2.0, backs_out=False))
    assert min(waits.speed_mps) > -0.05
    assert waits.reasons[-5] == "boxed in"
