"""A car without a tachometer (`pwm_drive`): it drives by its scans alone, and what they and its board show stops it."""

import numpy as np
import pytest

from tests.system.pwm_drive import PwmDrive
from wallride.drivers.api import LinkState
from wallride.drivers.pca9685.settings import Pca9685Settings


def test_it_follows_the_wall_at_one_metre_a_second_by_its_scans_alone():
    seen = PwmDrive("loop").run(12.0)
    moving = seen[seen[:, 0] > 5.0]
    assert np.abs(moving[:, 2] - 1.0).mean() < 0.10
    assert moving[:, 1].mean() == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_it_does_so_with_the_slowest_lidar():
    drive = PwmDrive("loop", lidar="x2")
    seen = drive.run(14.0)
    moving = seen[seen[:, 0] > 4.0]
    assert np.abs(moving[:, 2] - 1.0).mean() < 0.10
    assert np.abs(moving[:, 1] - 1.0).max() < 0.4
    assert not moving[:, 3].any(), "it is told its speed all the time"


def test_between_bare_walls_it_is_slow_and_says_so():
    said = []
    drive = PwmDrive("corridor")
    seen = drive.run(6.0, (5.0, lambda it: said.extend(it.car.status()["window"])))
    most_mps = Pca9685Settings().blind_speed_mps
    assert seen[:, 1].max() < 1.4 * most_mps  # its ESC drives 1.25 times as fast as it is said to
    assert seen[-1, 0] > 5.5
    assert any("the scans do not tell the speed" in words for words in said)
    assert any("no command timeout" in words for words in said)


@pytest.mark.parametrize(
    ("motor", "most_mps", "why"),
    [({}, 1.5, "its board has no command timeout"), ({"max_speed_mps": 0.8}, 0.8, "motor.max_speed_mps")],
)
def test_what_its_motor_allows_is_what_the_car_decides_and_why(motor, most_mps, why):
    drive, decided = PwmDrive("corridor", speed_mps=3.0, **motor), []
    drive.run(4.0, (3.5, lambda it: decided.append(it.car.mux.output.decision)))
    assert (decided[0].speed_mps, decided[0].winner) == (most_mps, "motor")
    assert decided[0].reason == f"no faster with this motor ({why})"


def test_the_last_pulse_brakes():
    drive = PwmDrive("loop")
    drive.run(3.0)
    assert drive.esc.demand(0.0).kind in {"brake", "coast"}
    assert drive.esc.speed_mps is None


@pytest.mark.parametrize("fault", ["nack", "brown-out"])
def test_a_lost_board_stops_the_car_with_its_reason_and_it_comes_back(fault):
    reasons = []

    def break_it(it):
        if fault == "nack":
            it.chip.nack_every = 1
        else:
            it.chip.brown_out()

    def look(it):
        reasons.append((it.motor.health.link, it.motor.health.message, it.reason()))
        it.chip.nack_every = None

    seen = PwmDrive("loop").run(9.0, (4.0, break_it), (4.3, look))
    link, message, reason = reasons[0]
    assert link is not LinkState.READY
    assert reason == "the motor controller reports nothing (power, cable?)"
    assert ("no acknowledgement" if fault == "nack" else "it was reset while it drove") in message or "arm" in message
    assert seen[(seen[:, 0] > 4.2) & (seen[:, 0] < 7.0), 1].min() < 0.05
    assert seen[-1, 1] > 0.5


def test_an_esc_that_is_off_is_a_fault_with_its_remedy():
    faults = []

    def switch_off(it):
        it.esc.pulse = lambda *_: None
        it.esc.no_signal()

    PwmDrive("loop").run(9.0, (4.0, switch_off), (8.9, lambda it: faults.append(it.motor.state.fault)))
    assert "the scans show no motion" in faults[0]
