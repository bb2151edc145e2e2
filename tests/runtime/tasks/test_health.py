"""The caretaker's rounds: faults hold the e-stop, and whatever comes back wants a release."""

from dataclasses import replace

import pytest

from drivers.api import Health, LinkState, MotorState
from runtime.command import LAB_ORDER
from runtime.emergency_stop import Cause, EmergencyStop
from runtime.service_manager import ServiceManager
from runtime.tasks.health import FAULT_RETRY_S, Caretaker
from runtime.voices import Voices

FINE = MotorState(0.0, 0.0, 0.0, 0.0, 12.0, 0.0, 0.0, 30.0, "", timed_out=False, killed=False)


class Device:
    """A lidar or a motor that is whatever the test says."""

    def __init__(self):
        self.health = Health(LinkState.READY, "fine", "twin")
        self.state = FINE
        self.cleared = 0

    def latch_fault(self, words):
        self.state = replace(self.state, fault=words)

    def clear_fault(self):
        self.cleared += 1

    def send(self, drive):
        return True

    async def run(self, *_):
        raise AssertionError("nobody runs it here")


class Ward:
    """A caretaker and everything it looks at."""

    def __init__(self, *, retry_faults=False):
        self.now_s = 0.0
        self.lidar, self.motor = Device(), Device()
        self.e_stop = EmergencyStop(Voices(LAB_ORDER, lambda: self.now_s))
        self.rearmed = []
        self.caretaker = Caretaker(
            lidar=self.lidar,
            motor=self.motor,
            output=lambda: None,
            emergency_stop=self.e_stop,
            rearm=self.rearmed.append,
            manager=ServiceManager({}),
            clock=lambda: self.now_s,
            retry_faults=retry_faults,
        )
        self.caretaker.check()

    def look(self, seconds=0.05):
        self.now_s += seconds
        self.caretaker.check()


@pytest.fixture
def ward():
    return Ward()


def test_coming_up_for_the_first_time_is_no_incident(ward):
    ward.look()
    assert ward.rearmed == []


@pytest.mark.parametrize("name", ["lidar", "motor"])
@pytest.mark.parametrize("state", [LinkState.ABSENT, LinkState.STARTING, LinkState.FAULTY])
def test_a_device_rearms_when_it_goes_and_again_when_it_is_back(ward, name, state):
    device = getattr(ward, name)
    words = f"the {name} was lost; permit again"
    device.health.link = state
    ward.look()
    ward.look()
    assert ward.rearmed == [words]
    device.health.link = LinkState.STARTING
    ward.look()
    assert ward.rearmed == [words]
    device.health.link = LinkState.READY
    ward.look()
    ward.look()
    assert ward.rearmed == [words, words]


@pytest.mark.parametrize(
    ("change", "words"),
    [({"fault": "DRV"}, "motor fault: DRV"), ({"killed": True}, "the motor controller's kill switch is on")],
)
def test_a_motor_fault_holds_the_e_stop_until_the_motor_says_that_it_is_over(ward, change, words):
    ward.motor.state = replace(FINE, **change)
    ward.look()
    assert ward.e_stop.causes == {Cause.MOTOR: words}
    assert len(ward.rearmed) == 1
    ward.motor.state = None  # unplugged: nobody says that it is over
    ward.look(60)
    assert ward.e_stop.latched
    ward.motor.state = FINE
    ward.look()
    assert not ward.e_stop.latched
    assert len(ward.rearmed) == 2
    assert ward.motor.cleared == 0


def test_the_end_of_a_motor_fault_does_not_open_an_operators_e_stop(ward):
    ward.motor.state = replace(FINE, fault="DRV")
    ward.look()
    ward.e_stop.latch(Cause.OPERATOR, "e-stop by Ann")
    ward.motor.state = FINE
    ward.look()
    assert ward.e_stop.causes == {Cause.OPERATOR: "e-stop by Ann"}


def test_without_an_operator_a_fault_is_tried_again():
    ward = Ward(retry_faults=True)
    ward.motor.state = replace(FINE, fault="DRV")
    ward.look()
    ward.look(FAULT_RETRY_S)
    assert ward.motor.cleared == 0
    ward.look()
    assert ward.motor.cleared == 1
