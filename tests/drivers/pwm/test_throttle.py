"""What an ESC is sent: a brake only where it brakes, neutral where the same pulse would drive backward."""

import pytest
from pydantic import ValidationError

from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pwm.throttle import HOLD_S, MAX_BRAKE_S, RELEASE_S, Throttle, steering_rad, steering_us
from wallride.sim.devices.esc import EmulatedEsc

SETTINGS = MaestroSettings()
NEUTRAL_US, BRAKE_US = SETTINGS.neutral_us, SETTINGS.brake_us


@pytest.fixture
def throttle():
    made = Throttle(SETTINGS)
    made.begin(0.0)
    return made


def test_a_stop_of_an_armed_esc_is_neutral_because_a_brake_would_drive_backward(throttle):
    assert throttle.pulse_us(0.0, 0.0, 1.0) == NEUTRAL_US
    assert throttle.last_us() == NEUTRAL_US


def test_a_stop_after_driving_brakes_until_the_car_has_stood_then_it_is_neutral(throttle):
    assert throttle.pulse_us(1.0, 1.0, 1.0) == SETTINGS.forward_us + SETTINGS.throttle_us_per_mps
    assert throttle.last_us() == BRAKE_US
    assert throttle.pulse_us(0.0, 1.0, 1.1) == BRAKE_US
    assert throttle.pulse_us(0.0, 0.0, 1.2) == BRAKE_US
    assert throttle.pulse_us(0.0, 0.0, 1.2 + 0.9 * HOLD_S) == BRAKE_US
    assert throttle.pulse_us(0.0, 0.0, 1.2 + 1.1 * HOLD_S) == NEUTRAL_US
    assert throttle.pulse_us(0.0, 0.0, 9.0) == NEUTRAL_US


def test_a_brake_ends_although_the_speed_is_said_to_stay(throttle):
    throttle.pulse_us(1.0, 1.0, 1.0)
    throttle.pulse_us(0.0, 1.0, 1.1)
    assert throttle.pulse_us(0.0, 1.0, 1.2 + MAX_BRAKE_S) == NEUTRAL_US


def test_backward_comes_after_a_brake_and_neutral(throttle):
    throttle.pulse_us(1.0, 1.0, 1.0)
    assert throttle.pulse_us(-0.5, 1.0, 1.1) == BRAKE_US
    assert throttle.braked_instead
    throttle.pulse_us(-0.5, 0.0, 1.2)
    assert throttle.pulse_us(-0.5, 0.0, 1.3 + HOLD_S) == NEUTRAL_US
    assert throttle.pulse_us(-0.5, 0.0, 1.3 + HOLD_S + 0.9 * RELEASE_S) == NEUTRAL_US
    assert throttle.pulse_us(-0.5, 0.0, 1.3 + HOLD_S + 1.1 * RELEASE_S) < SETTINGS.reverse_us
    assert not throttle.braked_instead


def test_a_car_that_rolls_backward_is_not_driven_forward(throttle):
    assert throttle.pulse_us(1.0, -0.6, 1.0) == NEUTRAL_US
    assert throttle.braked_instead


def test_no_pulse_goes_beyond_the_reach(throttle):
    assert throttle.pulse_us(50.0, 0.0, 1.0) == NEUTRAL_US + SETTINGS.throttle_reach_us


def test_an_esc_the_other_way_round_gets_mirrored_pulses():
    mirrored = MaestroSettings(forward_us=1450.0, reverse_us=1550.0, brake_us=1800.0)
    throttle = Throttle(mirrored)
    throttle.begin(0.0)
    assert throttle.pulse_us(1.0, 0.0, 1.0) == 1400.0
    assert throttle.pulse_us(0.0, 1.0, 1.1) == 1800.0


def test_whatever_is_asked_the_esc_never_drives_backward_unasked():
    """The emulated ESC, which is not built on the driver, decides what a pulse means."""
    throttle, esc, speed_mps, now_s = Throttle(SETTINGS), EmulatedEsc(), 0.0, 0.0
    throttle.begin(0.0)
    for _ in range(100):
        now_s += 0.02
        esc.pulse(1500.0, NEUTRAL_US, now_s)
    for step in range(4000):
        now_s += 0.02
        wanted_mps = (1.0, 0.0, 0.6, 0.0)[step // 37 % 4] if step % 11 else 0.0
        esc.wheels_mps = speed_mps
        esc.pulse(1500.0, throttle.pulse_us(wanted_mps, speed_mps, now_s), now_s)
        asked_mps = esc.speed_mps
        assert asked_mps is None or asked_mps > 0
        braked = esc.demand(now_s).kind == "brake"
        speed_mps += ((asked_mps or 0.0) - speed_mps) * (0.3 if braked or asked_mps else 0.02)


def test_the_servo_stays_within_its_linkage():
    assert steering_us(SETTINGS, 0.0) == SETTINGS.steering_center_us
    assert steering_us(SETTINGS, -9.0) == SETTINGS.steering_max_us
    assert steering_rad(SETTINGS, steering_us(SETTINGS, 0.2)) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"throttle_channel": 1}, "are both 1"),
        ({"forward_us": 1450.0}, "different sides"),
        ({"brake_us": 1700.0}, "brake_us"),
        ({"steering_center_us": 2000.0}, "steering_center_us"),
        ({"blind_speed_mps": 0.15}, "blind_speed_mps"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(wrong, words):
    with pytest.raises(ValidationError, match=words):
        MaestroSettings(**wrong)
