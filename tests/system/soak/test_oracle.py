"""The oracle of the soak is tested itself: each rule that it knows is broken once in the car, and it must say so."""

import math

import pytest

from tests.system.soak.oracle import AUTONOMY, RESET, SET_RPM, SET_SERVO_POS, Oracle, Promises
from tests.system.soak.virtual import suffer
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.calibration import Calibration
from wallride.drivers.vesc.condition import VescMonitor
from wallride.drivers.vesc.driver import Vesc
from wallride.runtime.arbitration import command, driving_state
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.arbitration.queues import NEVER_S
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.control.perception.plausibility import Plausibility
from wallride.runtime.tasks.battery import BatteryLimit
from wallride.runtime.tasks.health import HealthMonitor
from wallride.runtime.tasks.mux import SilenceTick
from wallride.runtime.teleop.desk import OperatorDesk
from wallride.runtime.wire.teleop import Press


def never_expires(patch):
    put = CommandQueue.put
    patch.setattr(CommandQueue, "put", lambda self, entry, *, expires_at_s=0: put(self, entry, expires_at_s=NEVER_S))


def lost_is_not_noticed(patch):
    never_expires(patch)
    patch.setattr(OperatorDesk, "_notice_silence", lambda *_: None)


def release_is_not_obeyed(patch):
    patch.setattr(OperatorDesk, "_release", lambda _self, session: setattr(session, "armed", True))


def nothing_latches(patch):
    patch.setattr(EmergencyStop, "latch", lambda *_: None)


def stop_is_no_stop(patch):
    nothing_latches(patch)
    patch.setattr(OperatorDesk, "_halt", lambda *_: None)
    patch.setattr(command, "is_stop", lambda _: False, raising=False)


def safety_is_overruled(patch):
    real = command._tightest
    patch.setattr(
        command,
        "_tightest",
        lambda word, caps: real(word, [cap for cap in caps if cap.source != command.Source.SAFETY]),
    )


def safety_is_exceeded(patch):
    real = command._tightest

    def tightest(word, caps):
        drive, (_, memories) = word.drive, real(word, caps)
        return command.Decision(drive.speed_mps, drive.steering_rad, word.source, word.source, word.reason), memories

    patch.setattr(command, "_tightest", tightest)


def fault_is_forgotten(patch):
    nothing_latches(patch)
    patch.setattr(VescMonitor, "_latch_fault", lambda *_: None)


def kill_switch_is_ignored(patch):
    patch.setattr(HealthMonitor, "_latch_fault", lambda *_: None)


def what_is_lost_disarms_nothing(patch):
    patch.setattr(OperatorDesk, "rearm", lambda *_: None)
    patch.setattr(OperatorDesk, "_must_wait", lambda *_: False)


def limits_are_off(patch):
    patch.setattr(Limiter, "_speed", lambda _self, wanted_mps, _dt_s: wanted_mps)


def steering_jumps(patch):
    patch.setattr(Limiter, "_steering", lambda self, wanted_rad, _dt_s: math.copysign(0.34, wanted_rad))


def everything_is_faster(patch):
    real = Calibration.speed_frame
    patch.setattr(Calibration, "speed_frame", lambda self, speed_mps: real(self, 1.3 * speed_mps))


def states_are_wrong(patch):
    patch.setattr(driving_state, "STATE_OF", dict.fromkeys(driving_state.Observation, driving_state.DrivingState.ARMED))


def silence_is_not_noticed(patch):
    patch.setattr(SilenceTick, "tick", lambda *_: None)


def battery_is_not_watched(patch):
    patch.setattr(BatteryLimit, "tick", lambda *_: None)
    patch.setattr(BatteryLimit, "check", lambda self: self._queue.withdraw(command.Source.BATTERY))
    patch.setattr(VescMonitor, "_watch_battery", lambda *_: None)


def frozen_is_not_noticed(patch):
    patch.setattr(Plausibility, "_compare", lambda *_: None)


def stop_coasts(patch):
    zero = codec.frame(codec.plain(codec.Packet.SET_RPM) + bytes(4))
    patch.setattr(Calibration, "brake_frame", lambda *_: zero)


def stop_is_no_current(patch):
    zero = codec.frame(codec.plain(codec.Packet.SET_CURRENT) + bytes(4))
    patch.setattr(Calibration, "brake_frame", lambda *_: zero)


def hang_up_drives(patch):
    real = Vesc._hang_up

    def hang_up(self, link):
        link.write(self._calibration.speed_frame(1.0))
        self._decode = None
        real(self, link)

    patch.setattr(Vesc, "_hang_up", hang_up)


def mute_is_not_noticed(patch):
    patch.setattr(Vesc, "_miss_reply", lambda self, _now_s: setattr(self, "_awaiting", False))
    real = Vesc._ask

    def ask(self, link, period_s):
        self._replied_s = self._clock()
        return real(self, link, period_s)

    patch.setattr(Vesc, "_ask", ask)


BREACHES = {
    "no fresh scan": (never_expires, "lidar mute"),
    "no fresh press": (lost_is_not_noticed, "operator lost"),
    "e-stop": (stop_is_no_stop, "e-stop"),
    "released": (release_is_not_obeyed, "operator lets go"),
    "safety was not asked": (safety_is_overruled, ""),
    "more than safety allowed": (safety_is_exceeded, "hand before the lidar"),
    "hand before the lidar": (safety_is_overruled, "hand before the lidar"),
    "lidar covered": (safety_is_overruled, "lidar covered"),
    "lidar frozen": (frozen_is_not_noticed, "lidar frozen"),
    "fault latched": (fault_is_forgotten, "motor fault"),
    "motor kill switch": (kill_switch_is_ignored, "motor kill switch"),
    "pressed before the end of: lidar mute": (what_is_lost_disarms_nothing, "lidar mute"),
    "faster than it may rise": (limits_are_off, ""),
    "steers faster than the servo can": (steering_jumps, ""),
    "faster than asked or allowed": (everything_is_faster, ""),
    "motion in a state that does not move": (states_are_wrong, ""),
    "silence on the motor's wire": (silence_is_not_noticed, "lidar mute"),
    "empty battery": (battery_is_not_watched, "empty battery"),
    "a stop that does not brake": (stop_coasts, ""),
    "a motor command that is neither speed nor brake": (stop_is_no_current, ""),
    "the last word on a connection is no brake": (hang_up_drives, "motor mute"),
    "motor mute": (mute_is_not_noticed, "motor mute"),
}  # fmt: skip
"""A rule of the oracle, how the car is made to break it, and the fault in which it shows."""


@pytest.mark.slow
@pytest.mark.parametrize("rule", list(BREACHES))
def test_a_broken_rule_is_found(rule, monkeypatch):
    breach, fault = BREACHES[rule]
    breach(monkeypatch)
    assert rule in suffer(fault, sought=rule).violations


def test_a_car_that_keeps_the_rules_is_found_to_do_so():
    found = suffer("")
    assert found.violations == {}, found.kept
    assert found.moving > 40


def test_a_car_that_never_moves_is_stuck():
    def prepare(soak):
        soak.operator.wants = Press(0)
        soak.oracle.promises = Promises(stuck_s=3.0)

    assert suffer(prepare=prepare).violations == {"stuck": 2}


def an_oracle():
    """Return an oracle under which an operator permits and a scan is fresh."""
    oracle = Oracle(Promises(), lambda: math.inf)
    oracle.beat(0.0, 1)
    oracle.delivered(0.0, 0, 1)
    oracle.delivered(0.01, AUTONOMY, 1)
    return oracle


def rpm(speed_mps):
    return bytes((SET_RPM,)) + round(speed_mps * 4614).to_bytes(4, "big", signed=True)


def test_from_gear_to_gear_is_found():
    oracle = an_oracle()
    oracle.motor(0.02, rpm(0.25))
    oracle.motor(0.04, rpm(-0.25))
    assert oracle.violations == {"turned round without a stop": 1}


def test_a_steering_angle_beyond_the_limit_is_found():
    oracle = an_oracle()
    oracle.motor(0.02, bytes((SET_SERVO_POS,)) + (950 - 1).to_bytes(2, "big"))
    assert oracle.violations == {"steers beyond the limit": 1}


def test_a_press_without_a_release_after_an_outage_is_no_permit():
    oracle = an_oracle()
    oracle.disarm("lost", 0.02)
    oracle.delivered(0.03, AUTONOMY, 1)
    oracle.motor(0.05, rpm(0.25))
    assert oracle.violations == {"lost": 1}
    oracle.delivered(0.06, 0, 1)
    oracle.delivered(0.07, AUTONOMY, 1)
    oracle.motor(0.08, rpm(0.25))
    assert oracle.violations == {"lost": 1}


def test_a_fault_that_is_shown_while_a_reset_is_on_its_way_is_none():
    """The car may get the report first, and then the reset that clears it; what is shown later is latched."""
    oracle = Oracle(Promises(obeyed_s=0.1), lambda: math.inf)
    oracle.beat(0.0, 1)
    oracle.fault_shown(0.0, 0.25)
    oracle.delivered(0.0, 0, 1)
    oracle.delivered(0.01, RESET, 1)
    oracle.fault_shown(0.1, 0.25)
    oracle.beat(0.3, 2)
    oracle.delivered(0.3, 0, 2)
    oracle.delivered(0.31, AUTONOMY, 2)
    oracle.motor(0.4, rpm(0.25))
    assert not oracle.violations
    oracle.fault_shown(0.41, 0.0)
    oracle.motor(0.45, rpm(0.25))
    assert oracle.violations == {"fault latched": 1}


def test_a_press_that_echoes_an_old_beat_is_no_permit():
    oracle = an_oracle()
    oracle.motor(0.1, rpm(0.25))
    assert not oracle.violations
    oracle.delivered(0.25, AUTONOMY, 1)
    oracle.motor(0.26, rpm(0.25))
    assert set(oracle.violations) == {"no fresh press", "silence on the motor's wire"}
