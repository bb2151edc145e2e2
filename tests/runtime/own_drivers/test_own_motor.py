"""A motor's driver of the user: what it is given, what it may report, and that a brake is its last command."""

import asyncio
import math

import pytest

from wallride.drivers.api import NOT_OPENED, Drive, LinkState
from wallride.runtime.own_drivers.motor import OTHER_WAY, OwnMotor
from wallride.runtime.own_drivers.settings import OwnMotorSettings
from wallride.sim.virtual.virtual_time import run_virtual

DRIVER = """class Driver:
    def __init__(self, settings, clock):
        self.clock, self.health, self.state, self.sent = clock, Health(), None, []
        self.speed_mps, self.fault, self.cleared = 0.0, "", 0

    async def run(self):
        self.health.link = LinkState.READY
        for turn in range(1000):
            self.state = MotorState(self.clock(), self.speed_mps, 0.0, 0.0, fault=self.fault)
            if turn == 20:
                {then}
            await asyncio.sleep(0.02)

    def send(self, drive):
        self.sent.append(drive)
        {when_sent}
        return True

    def clear_fault(self):
        self.fault = ""
"""
GO, STOP = Drive(1.0, 0.1), Drive(0.0, 0.1)


class Running:
    """The motor and the user's object in it."""

    def __init__(self, name):
        self.clock = asyncio.get_running_loop().time
        self.motor = OwnMotor(OwnMotorSettings(driver=name), clock=self.clock)
        self.task = asyncio.create_task(self.motor.run())

    @property
    def made(self):
        return self.motor._run.made

    async def end(self):
        self.task.cancel()
        await asyncio.wait({self.task})


def story(driver_file, body, then="pass", when_sent="pass"):
    """Run a coroutine function with a running motor, in virtual time."""
    name = driver_file(DRIVER.format(then=then, when_sent=when_sent))

    async def main():
        running = Running(name)
        await asyncio.sleep(0.1)
        try:
            await body(running)
        finally:
            await running.end()
        return running

    return run_virtual(main())


def test_a_command_passes_as_it_is_and_the_last_one_is_a_brake(driver_file):
    async def body(running):
        assert running.motor.health.link is LinkState.READY
        assert running.motor.send(GO)
        assert running.made.sent == [GO]
        assert not running.motor.braked_instead

    made = story(driver_file, body).made
    assert made.sent == [GO, Drive(0.0, 0.1)]


def test_what_must_not_be_driven_is_braked(driver_file):
    async def body(running):
        motor, sent = running.motor, running.made.sent
        motor.send(GO)
        for bad in (Drive(math.nan, 0.2), Drive(math.inf, 0.2), Drive(1.0, math.nan)):
            motor.send(bad)
            assert sent[-1] == Drive(0.0, 0.1)
            assert motor.braked_instead
        motor.send(Drive(0.1, 0.2))  # below the motor's slowest
        assert sent[-1] == Drive(0.0, 0.2)
        running.made.speed_mps = 1.0
        await asyncio.sleep(0.05)
        motor.send(Drive(-1.0, 0.0))
        assert sent[-1].speed_mps == 0.0
        assert motor.braked_instead

    story(driver_file, body)


@pytest.mark.parametrize("whose", ["the car's", "the device's"])
def test_a_latched_fault_brakes_until_it_is_cleared(driver_file, whose):
    async def body(running):
        motor, sent = running.motor, running.made.sent
        if whose == "the car's":
            motor.latch_fault("runs backwards")
        else:
            running.made.fault = "too hot"
        await asyncio.sleep(0.05)
        assert motor.state.fault in {"runs backwards", "too hot"}
        assert motor.health.link is LinkState.FAULTY
        motor.send(GO)
        assert sent[-1].speed_mps == 0.0
        motor.retry_fault()
        await asyncio.sleep(0.05)
        assert bool(motor.state.fault) is (whose == "the car's")
        motor.clear_fault()
        await asyncio.sleep(0.05)
        assert not motor.health.trouble
        motor.send(GO)
        assert sent[-1] == GO

    story(driver_file, body)


@pytest.mark.parametrize(("speeds_mps", "latched"), [
    ((0.0, -0.1, -0.2, -0.3, -0.4, -0.2, -0.4, -0.2), True),  # braked above 0.3 m/s
    ((0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7), False),
    ((-0.1, -0.3, 0.0, 0.0, 0.1, 0.2, 0.3, 0.3), False),  # a reversal, in reports that lag
    ((-4.0, -4.3, -3.0, -2.0, -1.0, -0.2, 0.1, 0.2), False),
])  # fmt: skip
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_wheels_that_gain_speed_the_other_way_than_told_are_a_fault(driver_file, way, speeds_mps, latched):
    async def body(running):
        motor = running.motor
        for speed_mps in speeds_mps:
            running.made.speed_mps = way * speed_mps
            for _ in range(8):
                await asyncio.sleep(0.02)
                motor.send(Drive(way, 0.1))
        assert (motor.health.trouble == OTHER_WAY) is latched
        running.made.speed_mps = 0.0
        await asyncio.sleep(0.05)
        motor.send(Drive(way, 0.1))
        assert (running.made.sent[-1].speed_mps == 0.0) is latched

    story(driver_file, body)


@pytest.mark.parametrize(("link", "refused"), [("LinkState.READY", True), ("LinkState.CONNECTING", False)])
def test_a_driver_that_takes_no_command_although_it_is_ready_is_refused(driver_file, link, refused):
    async def body(running):
        running.made.health.link = LinkState.READY
        for _ in range(60):
            assert not running.motor.send(GO)
            await asyncio.sleep(0.02)
        health = running.motor.health
        assert ("answers commands with False although it says READY" in health.message) is refused

    story(driver_file, body, when_sent=f"self.health.link = {link}; return False")


MISTAKES = {
    "raises": ("raise ValueError('lost it')", "pass", "raised ValueError: lost it"),
    "send raises": ("pass", "if drive.speed_mps: raise KeyError('x')", "raised KeyError: 'x'"),
    "send raises what ends loops": (
        "pass",
        "if self.clock() > 0.3: raise BaseException('x')",
        "raised BaseException: x",
    ),
    "send answers": ("pass", "return None", "answered a command with a NoneType"),
    "type": ("self.state = 3", "pass", "reported a int where a MotorState is needed"),
    "speed": ("self.state.speed_mps = math.nan", "pass", "reported speed_mps that is no finite number"),
    "impossible": ("self.state.speed_mps = 99.0", "pass", "reported 99 m/s, which no such car drives"),
    "future": ("self.state.stamp_s += 9", "pass", "stamped a report 8.98 s in the future"),
    "no voltage": ("self.state.voltage_v = None", "pass", "reported voltage_v as a NoneType where a number is needed"),
    "text": ("self.state.input_current_a = '1'", "pass", "reported input_current_a as a str where a number is needed"),
    "array": ("self.state.killed = np.ones(2)", "pass", "reported killed as a ndarray where a bool is needed"),
    "no fault": ("self.state.fault = None", "pass", "reported fault as a NoneType where a str is needed"),
    "huge": ("self.state.distance_m = 10 ** 400", "pass", "raised OverflowError: int too large"),
    "back": ("self.state.stamp_s -= 0.1", "pass", "jumped back in time by 0.08 s"),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_is_a_brake_no_state_and_a_sentence_with_its_line(driver_file, what):
    then, when_sent, words = MISTAKES[what]

    async def body(running):
        made, seen = running.made, []
        for _ in range(40):
            running.motor.send(GO)
            _ = running.motor.state
            seen.append(running.motor.health)
            await asyncio.sleep(0.02)
        told = next(one for one in seen if one.link is LinkState.FAULTY)
        assert words in told.message
        assert ".py:" in told.message
        assert made.sent[-1].speed_mps == 0.0
        assert not running.motor.send(GO)
        assert running.motor.state is None
        await asyncio.sleep(1.5)
        assert running.made is not made, "it was not made anew"

    story(driver_file, body, then, when_sent)


def test_a_driver_that_hangs_is_lost_and_told_with_its_line(driver_file):
    async def body(running):
        await asyncio.sleep(1.0)
        assert running.motor.state is None
        assert running.motor.health.link is LinkState.FAULTY
        assert "no report for 0.7 s (it waits in" in running.motor.health.message

    story(driver_file, body, then="await asyncio.Event().wait()")


IN_PLACE = """
                while True:
                    self.state.stamp_s = self.clock()
                    if self.clock() > 0.6: {then}
                    await asyncio.sleep(0.02)"""


def test_a_report_that_is_updated_in_place_is_copied_into_plain_numbers(driver_file):
    async def body(running):
        await asyncio.sleep(0.7)
        before = running.motor.state
        before_m = before.distance_m
        await asyncio.sleep(0.1)
        after = running.motor.state
        assert before.distance_m == before_m
        assert 0.04 < after.distance_m - before_m < 0.08
        assert {type(after.speed_mps), type(after.distance_m), type(after.voltage_v)} == {float}

    then = "self.state.distance_m = np.float64(self.state.distance_m + 0.01)"
    story(driver_file, body, then=IN_PLACE.format(then=then))


@pytest.mark.parametrize(
    ("then", "words"),
    [
        ("self.state.stamp_s = 1e9", "stamped a report 1e+09 s in the future"),
        ("self.state.distance_m = math.nan", "reported distance_m that is no finite number"),
    ],
)
def test_a_mistake_in_a_report_that_is_updated_in_place_is_told(driver_file, then, words):
    async def body(running):
        told = []
        for _ in range(50):
            running.motor.send(GO)
            told.append(running.motor.health.message)
            await asyncio.sleep(0.02)
        assert any(words in one and ".py:" in one for one in told)
        assert not running.motor.send(GO) or running.motor.state is None

    story(driver_file, body, then=IN_PLACE.format(then=then))


def test_a_driver_that_repeats_its_report_is_lost(driver_file):
    async def body(running):
        await asyncio.sleep(1.0)
        assert running.motor.state is None

    story(driver_file, body, then="while True: await asyncio.sleep(0.02); self.state = self.state")


def test_before_it_runs_it_says_what_every_device_says(driver_file):
    """The doctor waits as long as this is said."""
    name = driver_file(DRIVER.format(then="pass", when_sent="pass"))
    motor = OwnMotor(OwnMotorSettings(driver=name), clock=lambda: 0.0)
    assert motor.health.message == NOT_OPENED
    assert motor.state is None
