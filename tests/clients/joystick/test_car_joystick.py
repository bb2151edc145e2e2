"""A pad on the car and the car's real desk, in virtual time: grab, release, unplug, replug, a pad that falls silent."""

import math
import os

import pytest

from tests.clients.joystick.fake_pads import F710_D, KEYBOARD, LB, RB, RIGHT_X, START, B, FakePad, Y
from tests.runtime.operator_rig import AUTO_MPS, BEAT_S, Rig
from wallride.clients.joystick.car_joystick import GONE_S, SILENT, CarJoystick
from wallride.clients.joystick.devices import MAX_TRIES, LinuxPads
from wallride.clients.joystick.evdev import EV_ABS, EV_KEY
from wallride.clients.teleop.pilot import PAD_SILENT_S
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.arbitration.command import Source
from wallride.runtime.wire.teleop import Press

LOST_WITHIN_S = 0.25
SHAPE = InputShape(max_speed_mps=2.0, max_steering_rad=0.3, deadzone=0.08, expo=0.0, ramp_mps2=math.inf)


class CarWithPads:
    """The rig of the desk with a folder of input devices."""

    def __init__(self, folder, permit):
        self.rig = Rig(permit)
        self.folder, self.devices, self.refused = folder, {}, set()
        self.pads = LinuxPads(folder, self.open)
        self.joystick = CarJoystick(self.pads, 77, SHAPE)
        self.rig.clients.append(self)
        self.jitters = True

    def open(self, path):
        if path in self.refused or path not in self.devices:
            raise PermissionError(13, "Permission denied")
        return self.devices[path]

    def plug(self, name="event3", pad=None):
        """Plug a pad in and let it be found."""
        pad = pad or FakePad()
        self.devices[self.folder / name] = pad
        (self.folder / name).touch()
        self.look()
        return pad

    def unplug(self, name="event3"):
        self.devices.pop(self.folder / name).pulled = True
        (self.folder / name).unlink()

    def look(self):
        """What `LinuxPads.watch` does each half second."""
        for path, device in self.pads.open_all(self.pads.untried()):
            self.pads.adopt(path, device)

    def hear(self, beat):
        self.joystick.hear(beat.pack(), self.rig.now_s)

    def go_on(self, seconds=0.2):
        """Let time pass; return the speeds that the mux would send."""
        speeds = []
        for _ in range(round(seconds / BEAT_S)):
            self.rig.wait(BEAT_S)
            for pad in self.devices.values():
                if self.jitters and not pad.pulled:
                    pad.jitter()
            command = self.joystick.command(self.rig.now_s)
            if command is not None:
                self.rig.desk.receive("", command, self.rig.now_s)
            speeds.append(abs(self.rig.speed_mps))
        return speeds

    def grab(self, pad):
        """Take the pad and drive."""
        self.go_on()
        pad.hold(LB)
        self.go_on()
        pad.push(1.0)
        assert self.go_on()[-1] == pytest.approx(2.0, abs=0.01)
        assert self.rig.decision.driver is Source.TELEOP


@pytest.fixture(params=["required", "always"])
def car(request, tmp_path):
    return CarWithPads(tmp_path, request.param)


def test_grab_and_release(car):
    pad = car.plug()
    car.grab(pad)
    pad.push(0.5, RIGHT_X)
    car.go_on()
    assert car.rig.decision.steering_rad > 0.1, "left is positive"
    pad.hold()
    pad.push(0.0)
    speeds = car.go_on()
    assert speeds[2] == (0.0 if car.rig.permit.always is False else AUTO_MPS), "an explicit release is a release"


def test_without_a_pad_nothing_is_said(car):
    car.go_on(1.0)
    assert car.rig.desk.view().sessions == 0
    assert car.joystick.command(car.rig.now_s) is None


def test_a_pad_that_only_lies_there_moves_nothing(tmp_path):
    car = CarWithPads(tmp_path, "required")
    car.plug()
    assert max(car.go_on(2.0)) == 0.0


def test_a_pad_that_is_pulled_while_it_drives_brakes_and_autonomy_does_not_take_over(car):
    car.grab(car.plug())
    car.unplug()
    speeds = car.go_on(3.0)
    assert speeds[round(LOST_WITHIN_S / BEAT_S):] == [0.0] * (len(speeds) - round(LOST_WITHIN_S / BEAT_S))  # fmt: skip
    assert speeds[0] == 0.0, "in the very next tick: it is known to be gone"


@pytest.mark.parametrize("held", [True, False])
def test_a_pad_that_comes_back_drives_after_a_release_alone(held, car):
    car.grab(car.plug())
    car.unplug()
    car.go_on(0.3)
    pad = FakePad()
    if held:  # plugged in again with the deadman and the stick held
        pad.values[EV_KEY, LB], pad.values[EV_ABS, 1] = 1, -32767
    car.plug("event9", pad)
    if held:
        assert max(car.go_on(1.0)) == 0.0
        pad.hold()
        pad.push(0.0)
    car.grab(pad)


def test_a_pad_that_falls_silent_stops_the_car(car, caplog):
    caplog.set_level("INFO", "wallride.joystick")
    pad = car.plug()
    car.grab(pad)
    car.jitters = False  # switched off: its dongle stays, and the last state with it
    speeds = car.go_on(PAD_SILENT_S + 0.5)
    assert speeds[round(0.9 / BEAT_S)] == 2.0
    assert set(speeds[round((PAD_SILENT_S + 0.1) / BEAT_S):]) == {0.0}  # fmt: skip
    pad.hold()
    pad.push(0.0)
    car.go_on()
    told = [record.message for record in caplog.records if record.name == "wallride.joystick"]
    assert told[-2:] == [SILENT, "Logitech F710 (X): hold LB to drive, RB to permit"]


def test_a_reader_that_hangs_is_a_lost_operator(car):
    car.grab(car.plug())
    car.rig.wait(LOST_WITHIN_S)
    assert car.rig.speed_mps == 0.0
    assert car.rig.standing == "operator lost"


def test_stop_and_reset(car):
    pad = car.plug()
    car.grab(pad)
    pad.hold(LB, B)
    assert car.go_on(0.04)[-1] == 0.0
    assert car.rig.e_stop.latched
    pad.hold()
    pad.push(0.0)
    assert max(car.go_on(1.0)) == 0.0
    pad.hold(START)
    car.go_on(1.3)
    assert not car.rig.e_stop.latched
    pad.hold()
    car.grab(pad)


def test_both_deadmen_at_once_are_a_stop(car):
    pad = car.plug()
    car.grab(pad)
    pad.hold(LB, RB)
    car.go_on(0.04)
    assert car.rig.e_stop.latched


def test_the_permit_is_held(tmp_path):
    car = CarWithPads(tmp_path, "required")
    pad = car.plug()
    car.go_on()
    pad.hold(RB)
    assert car.go_on()[-1] == AUTO_MPS
    pad.hold()
    assert car.go_on(0.04)[-1] == 0.0


def test_a_release_among_lost_records_is_seen(tmp_path):
    car = CarWithPads(tmp_path, "required")
    pad = car.plug()
    car.grab(pad)
    pad.set(EV_KEY, LB, 0, seen=False)
    pad.overflow()
    assert car.go_on(0.04)[-1] == 0.0
    assert not car.rig.e_stop.latched, "what was pressed among the lost is asked for, not believed"


def test_another_operator_keeps_the_car_until_it_is_taken_over(tmp_path):
    car = CarWithPads(tmp_path, "required")
    pad, ann = car.plug(), car.rig.client()
    car.go_on()
    ann.hold(Press(0))
    ann.hold(Press.MANUAL)
    assert car.rig.desk.view().operator == "Ann"
    pad.hold(LB)
    car.go_on(0.04)
    assert car.rig.desk.view().operator == "Ann"
    pad.hold()
    car.go_on(0.1)
    ann.hold(Press.MANUAL)
    pad.hold(Y)
    for _ in range(60):
        car.go_on(BEAT_S)
        ann.hold(Press.MANUAL)
    assert car.rig.desk.view().operator == "the pad on the car"


def test_when_a_lost_pad_stays_away_another_operator_may_drive(tmp_path):
    car = CarWithPads(tmp_path, "required")
    car.grab(car.plug())
    car.unplug()
    car.go_on(GONE_S + 3.2)
    assert car.rig.desk.view().operator == ""


def test_the_second_pad_takes_the_place_of_the_first_with_a_release(car):
    car.grab(car.plug())
    other = car.plug("event4", FakePad(F710_D))
    car.unplug()
    assert max(car.go_on(0.5)) == 0.0
    other.set(EV_KEY, 292, 1)  # LB in mode D
    car.go_on()
    other.push(1.0)
    assert car.go_on()[-1] == pytest.approx(2.0, abs=0.01)


def test_what_is_no_pad_is_closed_and_not_opened_again(tmp_path):
    car = CarWithPads(tmp_path, "required")
    keyboard = car.plug("event0", FakePad(KEYBOARD))
    assert keyboard.closed
    assert car.pads.untried() == []
    os.mkfifo(tmp_path / "mouse0")
    assert car.pads.untried() == []


def test_a_pad_is_tried_until_udev_has_given_it_its_group(tmp_path):
    car = CarWithPads(tmp_path, "required")
    car.refused.add(tmp_path / "event3")
    pad = car.plug()
    for _ in range(MAX_TRIES // 2):
        car.look()
    car.refused.clear()
    car.look()
    car.grab(pad)
    car.refused.add(tmp_path / "event4")
    car.plug("event4")
    for _ in range(MAX_TRIES):
        car.look()
    assert car.pads.untried() == [], "then it is a matter of rights"


def test_a_folder_that_is_missing_is_a_computer_without_pads(tmp_path):
    assert LinuxPads(tmp_path / "none").untried() == []
