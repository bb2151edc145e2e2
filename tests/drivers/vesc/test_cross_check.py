"""What contradicts itself: by the numbers in virtual time, and through the driver against the emulated controller."""

import asyncio
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.vesc.rig import BRAKE, ready, seen
from tests.drivers.vesc.test_condition import WELL
from tests.waiting import until
from wallride.drivers.api import Drive, Health, LinkState
from wallride.drivers.vesc.calibration import Calibration
from wallride.drivers.vesc.condition import VescMonitor
from wallride.drivers.vesc.cross_check import COUNTS_WRONG, RUNS_BACKWARDS, CrossCheck
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.devices.vesc import VescEmulator

PERIOD_S = 0.02
GAIN = VescSettings().speed_to_erpm_gain
METRES_PER_STEP = 10 / GAIN


class Car:
    """A motor that obeys and reports as it is told, polled in virtual time."""

    def __init__(self):
        self.health = Health()
        self.condition = VescMonitor(Calibration(VescSettings()), 8.0, self.health)
        self.now_s = self.way_m = self.counted_m = 0.0

    def poll(self, speed_mps, *, wish=None, counted=1.0, seconds=PERIOD_S):
        """Report this speed; counted: the share of the way that the counter shows. Returns whether it was believed."""
        if wish is not None:
            self.condition.asked(wish)
        self.now_s += seconds
        self.counted_m += counted * speed_mps * seconds
        steps = round(self.counted_m / METRES_PER_STEP)
        self.way_m += abs(counted * speed_mps * seconds)
        values = replace(
            WELL, erpm=round(speed_mps * GAIN), tachometer=steps, tachometer_abs=round(self.way_m / METRES_PER_STEP)
        )
        return self.condition.update(values, self.now_s, 0.0)

    def drive(self, seconds, speed_mps, **more):
        for _ in range(round(seconds / PERIOD_S)):
            self.poll(speed_mps, **more)
        return self.condition.fault


@pytest.fixture
def car():
    car = Car()
    car.drive(0.1, 0.0, wish=0.0)
    return car


@pytest.mark.parametrize("erpm", [10**6, 10**7, 2**31 - 1, -(2**31)])
def test_an_impossible_speed_is_no_report(car, erpm):
    car.drive(1.0, 1.0, wish=1.0)
    before = car.condition.state
    for poll in range(15):
        assert not car.condition.update(replace(WELL, erpm=erpm), car.now_s + 0.02 * (poll + 1), 0.0)
        assert car.condition.state is before
        assert car.condition.blind is (poll > 0), "one is passed over, from the second on it brakes"
    car.now_s += 0.3
    assert car.poll(1.0)
    assert (car.condition.blind, car.condition.refused_mps, car.condition.fault) == (False, None, "")


def test_where_polls_are_rare_the_first_refusal_brakes():
    condition = VescMonitor(Calibration(VescSettings(poll_hz=10, lost_after_s=0.4)), 8.0, Health())
    assert condition.update(WELL, 1.0, 0.0)
    assert not condition.update(replace(WELL, erpm=10**6), 1.1, 0.0)
    assert condition.blind


def test_no_car_gains_ten_metres_a_second_within_a_poll_but_locks_its_wheels_in_one(car):
    assert car.poll(1.0)
    assert not car.poll(11.0)
    assert car.poll(5.0), "wheels that spin up in the air"
    assert car.poll(0.0)


def test_after_a_long_silence_no_more_is_believed_than_after_a_tenth_of_a_second():
    check = CrossCheck(METRES_PER_STEP)
    assert not check.is_possible(18.1, 1000.0)
    assert check.is_possible(17.9, 1000.0)


@given(speed_mps=st.floats(60.0, 1e300, exclude_min=True), last_mps=st.floats(0, 60.0))
def test_nothing_makes_more_than_sixty_metres_a_second_possible(speed_mps, last_mps):
    check = CrossCheck(METRES_PER_STEP)
    check.judge(last_mps, 0.0, 1.0)
    assert not check.is_possible(speed_mps, 2.0)
    assert not check.is_possible(-speed_mps, 2.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_asked_one_way_and_reported_the_other_for_a_third_of_a_second_is_a_fault_with_its_remedy(car, direction):
    assert car.drive(0.26, -0.5 * direction, wish=direction) == ""
    assert car.drive(0.1, -0.5 * direction, wish=direction) == RUNS_BACKWARDS
    assert car.condition.trouble == "runs backwards: swap two phases of the motor"
    assert car.health.counts["fault"] == 1


def test_a_motor_that_is_braked_whenever_it_runs_backwards_too_fast_is_found_too(car):
    for _ in range(6):
        car.drive(0.04, -0.35, wish=1.0)
        car.drive(0.04, -0.05, wish=1.0)
    assert car.drive(0.2, -0.35, wish=1.0) == RUNS_BACKWARDS


def test_the_ramp_after_each_of_those_brakes_hides_it_not(car):
    limiter = Limiter(CarSettings())
    for _ in range(40):
        drive = limiter.limit(1.0, 0.0, PERIOD_S)
        car.poll(-0.35, wish=drive.speed_mps)
        if drive.speed_mps > VescSettings().min_speed_mps:
            limiter.braked()
    assert car.condition.fault == RUNS_BACKWARDS


@pytest.mark.parametrize(("from_mps", "to_mps"), [(1.0, -0.5), (-1.0, 2.0), (4.0, -1.0)])
def test_a_change_of_direction_on_a_slippery_floor_is_no_fault(car, from_mps, to_mps):
    assert car.drive(0.5, from_mps, wish=from_mps) == ""
    speed_mps, sign = from_mps, 1 if from_mps > 0 else -1
    while speed_mps * sign > 0:
        speed_mps -= sign * 2.0 * PERIOD_S
        car.poll(speed_mps, wish=to_mps)
    assert car.drive(0.5, to_mps, wish=to_mps) == ""


@pytest.mark.parametrize("wish", [0.0, 0.1])
def test_rolling_back_while_no_speed_is_asked_is_no_fault(car, wish):
    assert car.drive(2.0, -0.5, wish=wish) == ""


def test_a_cleared_fault_that_is_still_there_comes_back(car):
    car.drive(0.5, -0.5, wish=1.0)
    car.condition.clear_fault()
    assert car.condition.fault == ""
    assert car.drive(0.7, -0.5, wish=1.0) == RUNS_BACKWARDS


@pytest.mark.parametrize("counted", [0.0, -1.0, 0.3, 3.0])
def test_a_counter_that_contradicts_the_speed_is_a_fault(car, counted):
    assert car.drive(0.9, 1.0, wish=1.0, counted=counted) == COUNTS_WRONG


@pytest.mark.parametrize("counted", [0.7, 1.0, 1.4])
def test_a_counter_that_is_a_little_off_is_none(car, counted):
    assert car.drive(3.0, 1.0, wish=1.0, counted=counted) == ""


def test_braking_with_locked_wheels_and_late_reports_are_no_contradiction(car):
    car.drive(1.0, 4.0, wish=4.0)
    for _ in range(5):
        car.poll(0.0, wish=0.0)
        car.drive(0.2, 3.0, wish=3.0)
    for poll in range(40):
        car.poll(2.0, wish=2.0, seconds=0.2 if poll % 4 else 0.02)
    assert car.condition.fault == ""


def test_a_reboot_while_driving_is_no_contradiction(car):
    car.drive(1.0, 1.0, wish=1.0)
    for poll in range(50):
        values = replace(WELL, erpm=round(GAIN), tachometer=9 * poll, tachometer_abs=9 * poll)
        car.condition.update(values, car.now_s + 0.02 * (poll + 1), 0.0)
    assert car.condition.fault == ""
    assert car.health.counts == {"reboot": 1}


async def turning(vesc: Vesc, emulator: VescEmulator, wish_mps: float, met) -> None:
    """Send a speed every 10 ms, and turn the emulated motor as it is asked, until something is so."""
    loop = asyncio.get_running_loop()
    way_m, last_s = 0.0, loop.time()
    async with asyncio.timeout(10.0):
        while not met():
            vesc.send(Drive(wish_mps, 0.0))
            await asyncio.sleep(0.01)
            now_s = loop.time()
            demand = emulator.demand(now_s)
            speed_mps = demand.value / GAIN if demand.kind == "speed" else 0.0
            way_m, last_s = way_m + speed_mps * (now_s - last_s), now_s
            emulator.report(erpm=round(speed_mps * GAIN), tachometer=round(way_m / METRES_PER_STEP))


async def test_an_impossible_speed_that_stays_is_a_lost_link_that_says_why(emulator):
    async with ready(emulator, lost_after_s=0.2) as vesc:
        emulator.shown_erpm = 10**7
        await until(lambda: "it reports 2.17e+03 m/s" in vesc.health.message)
        assert "motor.speed_to_erpm_gain" in vesc.health.message
        assert vesc.state is None


@pytest.mark.parametrize(("fault", "words"), [("backwards", RUNS_BACKWARDS), ("counter_stopped", COUNTS_WRONG)])
async def test_an_injected_contradiction_is_latched_and_every_command_is_a_brake(emulator, fault, words):
    async with ready(emulator) as vesc:
        setattr(emulator, fault, True)
        await turning(vesc, emulator, 1.0, lambda: vesc.health.link is LinkState.FAULTY)
        assert seen(vesc).fault == vesc.health.trouble == words
        count = len(emulator.motor_wire())
        vesc.send(Drive(1.0, 0.0))
        await until(lambda: len(emulator.motor_wire()) > count)
        assert emulator.motor_wire()[-1] == BRAKE
        setattr(emulator, fault, False)
        vesc.clear_fault()
        await turning(vesc, emulator, 1.0, lambda: seen(vesc).speed_mps > 0.9)
        assert vesc.health.link is LinkState.READY


async def test_an_absolute_counter_that_runs_down_is_counted_and_the_way_goes_on(emulator):
    emulator.abs_backwards = True
    async with ready(emulator) as vesc:
        await turning(vesc, emulator, 1.0, lambda: seen(vesc).distance_m > 0.5)
        assert vesc.health.counts.get("reboot", 0) <= 1
        assert vesc.health.counts["bad_counter"] > 5


async def test_a_motor_with_two_phases_swapped_drives_back_and_reports_ahead(emulator):
    async with ready(emulator) as vesc:
        emulator.phases_swapped = True
        vesc.send(Drive(1.0, 0.0))
        await until(lambda: emulator.demand(asyncio.get_running_loop().time()).value == -round(GAIN))
        emulator.report(erpm=-4614, tachometer=-100)
        await until(lambda: seen(vesc).speed_mps == 1.0)
