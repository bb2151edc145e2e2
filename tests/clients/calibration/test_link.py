"""The deadman of a calibration: without it nothing moves, and a stall needs a new press."""

import time
from dataclasses import replace

import numpy as np
import pytest

from wallride.clients.calibration import link as links
from wallride.clients.calibration.link import LetGoError, RemoteLink
from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.remote.car import RemoteCar
from wallride.clients.remote.driver import DriveRefusedError
from wallride.clients.remote.values import DriveSample, FieldsSample, MotorSample, ScanSample


class Hand:
    """What RemoteDriver is to the link."""

    def __init__(self, log):
        self.log = log
        self.trouble = ""
        self.refused = None

    def __enter__(self):
        self.log.append("begin")
        return self

    def __exit__(self, *_error):
        self.log.append("end")

    def send(self, speed_mps, steering_rad):
        if self.refused is not None:
            raise self.refused
        if self.trouble:
            raise DriveRefusedError(self.trouble)
        self.log.append((speed_mps, steering_rad))

    def release(self):
        self.log.append("release")


SCAN = ScanSample(3.0, -2.35, 0.005, 0.02, 30.0, np.ones(941, np.float32), 0.025, 2e-5)
MOTOR = MotorSample(2.0, 1.5, 0.4, 0.0, 0.1)


@pytest.fixture(autouse=True)
def _without_waiting(monkeypatch):
    monkeypatch.setattr(links, "SETTLES_S", 0.0)


class Car(RemoteCar):
    def __init__(self, samples=(MOTOR, SCAN)):
        self.log, self.hands, self.samples = [], [], samples

    def drive(self, **_limits):
        self.hands.append(Hand(self.log))
        return self.hands[-1]

    def topics(self, *_names, **_options):
        return iter([("", one) for one in self.samples])


class Deadman:
    key, again = "M", "Hold again."

    def __init__(self):
        self.held, self.renewed = True, 0

    def is_held(self):
        return self.held

    def renew(self):
        self.renewed += 1


def test_nothing_is_sent_once_the_deadman_is_released():
    car, deadman = Car(), Deadman()
    with RemoteLink(car, deadman, print) as link:
        link.send(0.4, 0.1)
        deadman.held = False
        with pytest.raises(LetGoError):
            link.send(0.4, 0.1)
    assert car.log == ["begin", (0.4, 0.1), "release", "end"]


def test_a_stall_begins_anew_after_a_new_press():
    car, deadman, told = Car(), Deadman(), []
    with RemoteLink(car, deadman, told.append) as link:
        car.hands[0].trouble = "nothing was sent for 0.2 s"
        link.send(0.4, 0.0)
        assert deadman.renewed == 1
        assert "Hold again" in told[0]
        link.send(0.4, 0.0)
    assert car.log == ["begin", "end", "begin", (0.4, 0.0), "end"]
    assert told[1:] == ["  it goes on"]


def test_what_waited_during_a_stall_is_neither_the_present_nor_time_in_which_the_car_drove(monkeypatch):
    waiting = [status_of(motor="absent: no usable reply"), SCAN, *[MOTOR, SCAN] * 50, status_of(), SCAN, SCAN]
    car = Car([MOTOR, SCAN, *waiting])
    car.name = "car1"
    with RemoteLink(car, Deadman(), print) as link:
        link.wait()
        monkeypatch.setattr(links, "SETTLES_S", 10.0)
        monkeypatch.setattr(time, "monotonic", lambda: 10.0 if link.seen.scans[52:] else 0.0)
        car.hands[0].trouble = "late"
        link.send(0.4, 0.0)
        assert len(link.seen.scans) == 53, "all of a while ago"
        monkeypatch.setattr(time, "monotonic", lambda: 11.0)
        link.wait()


def status_of(**gates):
    return FieldsSample(3.0, {"gates": {"lidar": "", "motor": "", **gates}})


@pytest.mark.parametrize("gates", [{"lidar": "absent: connection refused"}, {"motor": "absent: unplugged"}])
def test_a_device_that_is_gone_is_named_and_not_taken_for_a_slow_computer(gates):
    car, told = Car([SCAN, status_of(**gates), SCAN]), []
    car.name = "car1"
    ((device, why),) = gates.items()
    with RemoteLink(car, Deadman(), told.append) as link:
        link.wait()
        with pytest.raises(CalibrationError, match=f"^{device} {why}: see to its cable and power"):
            link.wait()
    assert (told, car.log) == ([], ["begin", "end"])


def test_a_long_drive_is_told_every_ten_seconds():
    scans = [replace(SCAN, stamp_s=3.0 + second) for second in range(25)]
    car, told = Car([MotorSample(3.0, 0.0, 0.0, 0.0, 0.0), *scans]), []
    with RemoteLink(car, Deadman(), told.append) as link:
        link.forget()
        for _ in scans[1:]:
            link.send(0.4, 0.0)
            link.wait()
    assert told == ["  it drives, for 10 s so far", "  it drives, for 20 s so far"]


def test_words_for_scripts_are_not_those_of_a_calibration():
    car, told = Car(), []
    with RemoteLink(car, Deadman(), told.append) as link:
        car.hands[0].refused = DriveRefusedError("nothing was sent for 0.2 s", "begin anew with car.drive()")
        link.send(0.4, 0.0)
    assert told[0] == "  nothing was sent for 0.2 s: the car stops. Hold again."


def test_a_computer_that_is_always_too_slow_is_given_up():
    car, deadman = Car(), Deadman()

    def stall():
        for _ in range(links.MAX_STALLS + 1):
            car.hands[-1].trouble = "late"
            link.send(0.4, 0.0)

    with RemoteLink(car, deadman, lambda _text: None) as link, pytest.raises(CalibrationError, match="too slow"):
        stall()


def test_samples_up_to_the_next_scan_are_taken_and_the_drive_is_renewed():
    car = Car([MOTOR, DriveSample(2.1, 0.4, 0.1), SCAN, SCAN])
    with RemoteLink(car, Deadman(), print) as link:
        link.send(0.4, 0.1)
        link.wait()
        assert link.now_s == 3.0
        assert (link.seen.motor, link.seen.commands) == ([(2.0, 1.5, 0.4, 0.1)], [(2.1, 0.4, 0.1)])
        assert link.seen.sweep_s == pytest.approx(2e-5 * 940)
        assert car.log.count((0.4, 0.1)) == 3
        link.wait()
        with pytest.raises(CalibrationError, match="ended"):
            link.wait()


def test_scans_that_stay_away_let_the_car_stop(monkeypatch):
    monkeypatch.setattr(links, "MAX_LATE_S", -1.0)
    car, deadman, told = Car([DriveSample(2.1, 0.4, 0.1), MOTOR, SCAN, SCAN]), Deadman(), []
    with RemoteLink(car, deadman, told.append) as link:
        link.send(0.4, 0.1)
        link.wait()
    assert deadman.renewed == 1
    assert "no scan" in told[0]
    assert car.log == ["begin", (0.4, 0.1), "end", "begin", "end"]


def test_the_sensors_own_period_counts_and_a_lost_scan_does_not():
    car = Car([SCAN, SCAN, replace(SCAN, scan_time_s=0.05)])
    with RemoteLink(car, Deadman(), print) as link:
        for _ in range(3):
            link.wait()
    assert link.seen.period_s == 0.025
