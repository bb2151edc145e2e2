"""The health_monitor's rounds: faults hold the e-stop, and whatever comes back wants a release."""

from dataclasses import replace
from itertools import pairwise

import pytest

from tests.runtime.tasks.test_battery import FINE
from wallride.drivers.api import Health, LinkState
from wallride.runtime.arbitration.command import LAB_ORDER
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import Cause, EmergencyStop
from wallride.runtime.host.systemd import ServiceManager
from wallride.runtime.tasks.health import FAULT_FORGOTTEN_S, FAULT_RETRY_S, MAX_FAULT_RETRY_S, HealthMonitor


class Device:
    """A lidar or a motor that is whatever the test says."""

    def __init__(self):
        self.health = Health(LinkState.READY, "fine", "twin")
        self.state = FINE
        self.braked_instead = False
        self.cleared = 0

    def latch_fault(self, words):
        self.state = replace(self.state, fault=words)

    def retry_fault(self):
        self.cleared += 1

    clear_fault = retry_fault

    def send(self, drive):
        return True

    async def run(self, *_):
        raise AssertionError("nobody runs it here")


class Ward:
    """A health_monitor and everything it looks at."""

    def __init__(self, *, retry_faults=False, **more):
        self.now_s = 0.0
        self.lidar, self.motor = Device(), Device()
        self.e_stop = EmergencyStop(CommandQueue(LAB_ORDER, lambda: self.now_s))
        self.rearmed = []
        self.health_monitor = HealthMonitor(
            lidar=self.lidar, motor=self.motor, output=lambda: None, emergency_stop=self.e_stop,
            rearm=self.rearmed.append, manager=ServiceManager({}), clock=lambda: self.now_s, retry_faults=retry_faults,
            **more,
        )  # fmt: skip
        self.health_monitor.check()

    def look(self, seconds=0.05):
        self.now_s += seconds
        self.health_monitor.check()


@pytest.fixture
def ward():
    return Ward()


def test_coming_up_for_the_first_time_is_no_incident(ward):
    ward.look()
    assert ward.rearmed == []


def test_a_message_that_only_counts_on_is_logged_once(ward, caplog):
    ward.lidar.health.link = LinkState.FAULTY
    for tenths in range(30):
        ward.lidar.health.message = f"lidar/scan: no scan for {tenths / 10:.1f} s"
        ward.look()
    assert len(caplog.messages) == 1
    ward.lidar.health.message = "lidar/scan: two publishers send scans: end one of them"
    ward.look()
    assert len(caplog.messages) == 2


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


def test_without_an_operator_a_fault_that_stays_is_tried_less_and_less_often_and_soon_again_after_a_good_while():
    ward = Ward(retry_faults=True)
    ward.motor.state = replace(FINE, fault="runs backwards")
    tried_s = []
    while ward.now_s < 200.0:
        ward.look()
        if ward.motor.cleared > len(tried_s):
            tried_s.append(ward.now_s)
    pauses_s = [later - sooner for sooner, later in pairwise([0.0, *tried_s])]
    assert pauses_s[:5] == pytest.approx([2, 4, 8, 16, 32], abs=0.2)
    assert pauses_s[5:] == pytest.approx([MAX_FAULT_RETRY_S] * len(pauses_s[5:]), abs=0.2)
    ward.motor.state = FINE
    ward.look()
    ward.look(FAULT_FORGOTTEN_S + 1)
    ward.motor.state = replace(FINE, fault="runs backwards")
    ward.look()
    tried = ward.motor.cleared
    ward.look(FAULT_RETRY_S + 0.1)
    assert ward.motor.cleared == tried + 1


def test_an_empty_battery_is_named_not_called_a_lost_motor(ward):
    words = "battery empty: 7.9 V, less than 8 V (charge or change it)"
    ward.motor.health = Health(LinkState.FAULTY, f"twin: {words}", "twin", words)
    ward.look()
    assert ward.rearmed == [f"{words}; permit again"]


def test_a_contradiction_between_wheels_and_scans_is_latched_as_a_motor_fault_until_it_is_cleared():
    doubt = ["runs backwards: swap two phases of the motor"]
    ward = Ward(motor_doubt=lambda: doubt[0])
    ward.look()
    assert ward.e_stop.causes == {Cause.MOTOR: "motor fault: runs backwards: swap two phases of the motor"}
    doubt[0] = ""
    ward.look(60)
    assert ward.e_stop.latched
    ward.motor.state = FINE
    ward.look()
    assert not ward.e_stop.latched


def test_a_lidar_that_repeats_itself_takes_the_permit_back_and_again_when_it_measures():
    doubt = [""]
    ward = Ward(lidar_doubt=lambda: doubt[0])
    doubt[0] = "the lidar repeats one scan"
    ward.look()
    ward.look()
    assert ward.rearmed == ["the lidar repeats one scan; permit again"]
    doubt[0] = ""
    ward.look()
    assert ward.rearmed == ["the lidar repeats one scan; permit again"] * 2
    assert not ward.e_stop.latched


@pytest.mark.parametrize("seen_away", [True, False])
def test_another_lidar_than_before_takes_the_permit_back_even_if_it_was_exchanged_in_a_blink(ward, seen_away):
    ward.lidar.health.identity = "UST-10LX, serial H1"
    ward.look()
    ward.rearmed.clear()
    if seen_away:
        ward.lidar.health.link = LinkState.ABSENT
        ward.look()
    ward.lidar.health.identity = "UST-10LX, serial H2"
    ward.lidar.health.link = LinkState.READY
    ward.look()
    words = "another lidar than before; check how it is mounted, permit again"
    assert ward.rearmed[-1] == words
    ward.look()
    ward.look()
    count = len(ward.rearmed)
    ward.look()
    assert len(ward.rearmed) == count


def test_the_same_lidar_coming_back_is_no_other_one(ward):
    ward.lidar.health.link = LinkState.ABSENT
    ward.look()
    ward.lidar.health.link = LinkState.READY
    ward.look()
    assert set(ward.rearmed) == {"the lidar was lost; permit again"}
