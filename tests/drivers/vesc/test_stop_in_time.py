"""The way of a stop through the driver, byte by byte, in virtual time: quick enough to run for each mutant of it."""

import asyncio
import math

import pytest

from tests.drivers.vesc.rig import GAIN, play
from wallride.drivers.api import Drive, LinkLost, LinkState
from wallride.drivers.vesc import codec, driver
from wallride.drivers.vesc.codec import Packet, frame
from wallride.drivers.vesc.cross_check import RUNS_BACKWARDS
from wallride.drivers.vesc.faults import fault_text
from wallride.drivers.vesc.settings import VescSettings

READY_S = 0.5
LOST_AFTER_S = 0.15
SERVO_AHEAD, SERVO_LEFT = frame(codec.set_servo(0.5304)), frame(codec.set_servo(0.5304 - 1.2135 * 0.1))
BRAKE = frame(codec.set_brake_current(VescSettings().brake_current_a))
ONE_MPS = frame(codec.set_erpm(4614))
WORDS = "a test"


def when_ready(story, **settings):
    async def waits(rig):
        await asyncio.sleep(READY_S)
        assert rig.vesc.health.link is LinkState.READY
        await story(rig)

    return play(waits, **settings)


def test_a_command_is_one_write_of_two_frames_and_a_stop_brakes():
    async def story(rig):
        assert rig.sent(Drive(1.0, 0.0)) == ONE_MPS + SERVO_AHEAD
        for linkage_ends_rad, position in ((1.5, 0.15), (-1.5, 0.85)):
            moves = frame(codec.set_erpm(9228)) + frame(codec.set_servo(position))
            assert rig.sent(Drive(2.0, linkage_ends_rad)) == moves
        assert not rig.vesc.braked_instead
        assert rig.sent(Drive(0.0, 0.1)) == BRAKE + SERVO_LEFT
        assert rig.sent(Drive(0.19, 0.1)) == BRAKE + SERVO_LEFT
        assert not rig.vesc.braked_instead
        assert rig.sent(Drive(0.0, 0.0, brake_mps2=0.85)) == frame(codec.set_brake_current(5.0)) + SERVO_AHEAD

    when_ready(story, brake_mps2_per_a=0.17)


@pytest.mark.parametrize(
    "bad", [Drive(math.nan, 0.0), Drive(math.inf, 0.0), Drive(1e300, 0.0), Drive(1.0, math.nan), Drive(0.0, math.inf)]
)
def test_a_command_that_is_none_is_a_brake_with_the_last_good_steering(bad):
    async def story(rig):
        rig.sent(Drive(1.0, 0.1))
        for times in (1, 2):
            assert rig.sent(bad) == BRAKE + SERVO_LEFT
            assert rig.vesc.health.counts["bad_command"] == times
            assert rig.vesc.braked_instead
        assert rig.sent(Drive(1.0, 0.0)) == ONE_MPS + SERVO_AHEAD
        assert not rig.vesc.braked_instead

    when_ready(story)


def test_nothing_is_sent_before_the_first_report():
    async def story(rig):
        assert not rig.vesc.send(Drive(0.0, 0.0))
        rig.vesc.brake_now()
        rig.controller.silent = True
        await asyncio.sleep(READY_S)
        assert not rig.vesc.send(Drive(1.0, 0.0))
        rig.vesc.brake_now()
        rig.vesc.latch_fault(WORDS)
        assert rig.vesc.health.link is LinkState.STARTING, "a fault tells nothing of a link"
        rig.vesc.clear_fault()
        assert rig.vesc.health.link is LinkState.STARTING

    rig = play(story)
    assert {payload[0] for _, payload in rig.controller.wire} == {Packet.FW_VERSION}
    assert "lost" not in rig.vesc.health.counts
    assert rig.released == 1


def test_a_port_that_takes_nothing_is_a_command_that_was_not_sent():
    async def story(rig):
        rig.sent(Drive(1.0, 0.0))
        rig.broken = True
        assert not rig.vesc.send(Drive(1.0, 0.0))
        rig.vesc.brake_now()
        rig.broken = False
        assert not rig.vesc.send(Drive(1.0, 0.0)), "it takes commands again from its next report on"
        rig.broken = True

    rig = when_ready(story)
    assert rig.vesc.health.counts["brake_not_written"] == 1
    assert rig.released == 1


def test_a_latched_fault_brakes_until_it_is_cleared():
    async def story(rig):
        vesc = rig.vesc
        vesc.latch_fault(WORDS)
        vesc.latch_fault("another")
        assert (vesc.health.link, vesc.health.trouble, vesc.state.fault) == (LinkState.FAULTY, WORDS, WORDS)
        assert vesc.health.message == f"{vesc.health.identity}: {WORDS}"
        assert vesc.health.counts["fault"] == 1
        assert rig.sent(Drive(1.0, 0.0)) == BRAKE + SERVO_AHEAD
        assert vesc.braked_instead
        vesc.clear_fault()
        assert (vesc.health.link, vesc.health.trouble, vesc.state.fault) == (LinkState.READY, "", "")
        assert rig.sent(Drive(1.0, 0.0)) == ONE_MPS + SERVO_AHEAD

    when_ready(story)


def test_a_fault_of_its_own_that_is_cleared_too_soon_comes_back():
    async def story(rig):
        rig.controller.inject_fault(3, fault_stop_s=10.0)
        await asyncio.sleep(0.1)
        assert rig.sent(Drive(1.0, 0.0)) == BRAKE + SERVO_AHEAD
        rig.vesc.clear_fault()
        await asyncio.sleep(0.1)
        assert rig.sent(Drive(1.0, 0.0)) == BRAKE + SERVO_AHEAD

    when_ready(story)


@pytest.mark.parametrize(("rolls", "wish_mps"), [(1.0, -1.0), (-1.0, 1.0)])
def test_it_brakes_before_it_drives_the_other_way(monkeypatch, rolls, wish_mps):
    monkeypatch.setattr(driver, "REVERSING_ABOVE_MPS", 0.5)

    async def story(rig):
        other_way = frame(codec.set_erpm(round(wish_mps * GAIN))) + SERVO_AHEAD
        for share, brakes in ((1.0, True), (0.5, False), (0.51, True), (0.4, False), (-0.6, False), (-1.0, False)):
            rig.controller.erpm = round(rolls * share * GAIN)
            await asyncio.sleep(0.1)
            assert rig.sent(Drive(wish_mps, 0.0)) == (BRAKE + SERVO_AHEAD if brakes else other_way)
            assert rig.vesc.braked_instead is brakes

    when_ready(story)


def test_no_direction_brakes_no_standing_and_no_unknown_car():
    async def story(rig):
        rig.controller.erpm = 0
        await asyncio.sleep(0.1)
        assert rig.sent(Drive(1.0, 0.0)) == ONE_MPS + SERVO_AHEAD
        rig.vesc._condition.state = None
        assert rig.sent(Drive(1.0, 0.0)) == ONE_MPS + SERVO_AHEAD

    when_ready(story)


def test_an_impossible_speed_is_braked_for_and_the_next_possible_one_obeyed():
    async def story(rig):
        rig.controller.shown_erpm = 10**6
        await asyncio.sleep(0.1)
        assert rig.sent(Drive(1.0, 0.0)) == BRAKE + SERVO_AHEAD
        assert rig.vesc.braked_instead
        assert rig.vesc.health.counts["bad_reply"] >= 2
        assert rig.vesc.state.speed_mps == pytest.approx(1.0)
        rig.controller.shown_erpm = None
        await asyncio.sleep(0.1)
        assert rig.sent(Drive(1.0, 0.0)) == ONE_MPS + SERVO_AHEAD

    when_ready(story)


def test_a_fault_is_latched_from_a_report_whose_speed_is_impossible():
    """It is shown for half a second only: what is refused for its speed may be all that ever shows it."""

    async def story(rig):
        rig.controller.shown_erpm = 10**6
        rig.controller.inject_fault(3, fault_stop_s=0.15)
        await asyncio.sleep(0.1)
        assert rig.vesc.health.link is LinkState.FAULTY
        assert rig.vesc.state.fault == rig.vesc.health.trouble == fault_text(3)
        rig.controller.shown_erpm = None
        await asyncio.sleep(0.1)
        assert rig.sent(Drive(1.0, 0.0)) == BRAKE + SERVO_AHEAD
        assert rig.vesc.health.counts["fault"] == 1

    when_ready(story)


def test_what_was_sent_is_compared_with_what_turns():
    async def story(rig):
        rig.controller.erpm = round(-0.25 * GAIN)
        for _ in range(40):
            rig.vesc.send(Drive(1.0, 0.0))
            await asyncio.sleep(0.025)
        assert rig.vesc.state.fault == RUNS_BACKWARDS

    when_ready(story)


@pytest.mark.parametrize("waits_s", [0.001 * number for number in range(0, 20, 3)])
def test_a_controller_that_falls_silent_is_lost_at_its_time_and_not_at_the_next_poll(waits_s):
    async def story(rig):
        await asyncio.sleep(waits_s)
        rig.sent(Drive(1.0, 0.0))
        rig.controller.silent = True
        await asyncio.sleep(0.3)
        (braked_s,) = [at_s for at_s, payload in rig.controller.wire if payload[0] == Packet.SET_CURRENT_BRAKE]
        assert braked_s - rig.vesc._replied_s == pytest.approx(LOST_AFTER_S, abs=1e-3)

    when_ready(story, lost_after_s=LOST_AFTER_S)


def test_a_timer_that_ends_a_moment_early_finds_the_link_lost():
    """Else it would ask for a pause of 1e-15 s again and again: in virtual time for ever."""

    async def story(rig):
        vesc = rig.vesc
        vesc._replied_s = vesc._clock() - LOST_AFTER_S + 1e-12
        with pytest.raises(LinkLost, match="no usable reply"):
            vesc._ask(None, 0.02)

    when_ready(story, lost_after_s=LOST_AFTER_S)


def test_the_last_word_is_a_brake_and_the_port_is_let_go():
    async def story(rig):
        rig.sent(Drive(1.0, 0.0))
        rig.vesc.latch_fault(WORDS)
        count = len(rig.writes)
        rig.vesc.brake_now()
        assert rig.writes[count:] == [BRAKE]

    rig = when_ready(story)
    vesc, health = rig.vesc, rig.vesc.health
    assert rig.writes[-1] == BRAKE
    assert rig.writes[-2] != frame(codec.plain(Packet.FW_VERSION))
    assert rig.writes.count(BRAKE) == 2
    assert rig.released == 1
    assert health.counts["lost"] == 1
    assert "brake_not_written" not in health.counts
    assert (health.link, health.message, health.trouble) == (LinkState.ABSENT, f"{vesc._address}: closed", "")
    assert vesc.state is None
    assert not vesc.send(Drive(1.0, 0.0))
    vesc.brake_now()
    assert rig.writes.count(BRAKE) == 2
