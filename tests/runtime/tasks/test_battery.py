"""The battery's voice: silent while all is well, above the human, and one word per change."""

import math
from dataclasses import replace

from tests.runtime.observed import HandClock
from wallride.drivers.api import Clock, Drive, MotorState
from wallride.runtime.arbitration.command import DriveCommand, QueueEntry, Source, arbitrate
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.battery import BatterySettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks.battery import BatteryLimit
from wallride.sim.virtual.devices import MemoryMotor

FINE = MotorState(0.0, 0.0, 0.0, 0.0, 12.0, 0.0, 0.0, 30.0, "", timed_out=False, killed=False)
ORDER = Settings().effective_order()


class Motor(MemoryMotor):
    """A controller that reports what the test sets."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self.report: MotorState | None = None

    @property
    def state(self) -> MotorState | None:
        return self.report


class Noted(CommandQueue):
    """A queue that keeps what was put."""

    said: tuple[QueueEntry, ...] = ()

    def put(self, entry, **expiry):
        self.said += (entry,)
        super().put(entry, **expiry)


class Car:
    """A stick pushed for 3 m/s, and a battery."""

    def __init__(self):
        self.clock = HandClock(0.0)
        self.queue = Noted(ORDER, self.clock)
        self.motor, self.rearmed = Motor(self.clock), []
        self.limit = BatteryLimit(BatterySettings(), self.motor, self.queue, self.rearmed.append)
        self.queue.put(DriveCommand(Source.TELEOP, Drive(3.0, 0.1), None, "ann drives"))

    def shows(self, voltage_v, seconds):
        for _ in range(round(seconds / 0.05)):
            self.clock.now_s += 0.05
            self.motor.report = replace(FINE, stamp_s=self.clock.now_s, voltage_v=voltage_v)
            self.limit.check()
        return arbitrate(self.queue.live(), frozenset(), ORDER)[0]


def test_the_battery_comes_right_after_the_e_stop():
    assert ORDER[:3] == (Source.ESTOP, Source.BATTERY, Source.TELEOP)


def test_it_holds_slows_and_stops_a_human_too_and_says_why():
    car = Car()
    assert car.shows(11.8, 1.0).speed_mps == 0.0
    assert car.shows(11.8, 2.0).speed_mps == 3.0
    assert car.queue.entry(Source.BATTERY) is None, "a good battery is silent"
    low = car.shows(10.1, 1.2)
    assert car.limit.stop == "", "slower is no stop"
    assert (low.speed_mps, low.winner, low.reason) == (1.0, Source.BATTERY, "battery low: 10.1 V; charge or change it")
    assert car.rearmed == []
    empty = car.shows(9.4, 1.2)
    assert (empty.speed_mps, empty.reason) == (0.0, "battery empty: 9.4 V; charge or change it")
    assert car.rearmed == ["battery empty: 9.4 V; charge or change it; permit again"]
    assert car.limit.stop == empty.reason
    assert len([word for word in car.queue.said if word.source is Source.BATTERY]) == 4, "one word per change"
    assert car.shows(11.9, 2.2).speed_mps == 3.0
    assert car.limit.stop == ""


def test_a_motor_controller_that_is_lost_is_the_reason_and_not_the_battery():
    car = Car()
    assert car.limit.stop == "no report of the motor controller yet (power, cable?)"
    assert car.shows(11.8, 0.1).reason == "the battery is being checked"
    assert car.shows(11.8, 3.0).speed_mps == 3.0
    car.motor.report = None
    car.limit.check()
    stopped = arbitrate(car.queue.live(), frozenset(), ORDER)[0]
    assert (stopped.speed_mps, stopped.winner) == (0.0, Source.BATTERY)
    assert stopped.reason == "the motor controller reports nothing (power, cable?)"
    assert car.shows(math.nan, 0.1).speed_mps == 3.0, "it measures no voltage"
