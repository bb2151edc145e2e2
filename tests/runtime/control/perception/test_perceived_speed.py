"""The speed of a scan: the wheels', by the time between their reports, and the car's own while they are locked."""

import numpy as np
import pytest

from tests.runtime.control.scans import CAR, SCAN_S, scan_of
from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.safety.swept import assumed
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.sim.virtual.devices import BEAMS


def speeds(reports):
    """Return the speed at each scan; reports: stamp and speed of the wheels' newest one at each, 25 ms apart."""
    perception, found = Perception(CAR, assumed(SweptSettings())), []
    for number, (stamp_s, speed_mps) in enumerate(reports):
        scan = scan_of(np.full(BEAMS, 9.0), 1.0 + SCAN_S * number, number)
        found.append(perception.look(scan, MotorState(stamp_s, speed_mps, 0.0, 0.0)).speed_mps)
    return found


@pytest.mark.parametrize(("report_s", "believed"), [(1.035, True), (1.015, False)])
def test_a_fall_between_two_scans_is_that_of_the_time_between_the_reports(report_s, believed):
    """At 50 reports and 40 scans a second, two of them come between two scans at times."""
    last_mps = speeds([(0.995, 5.42), (report_s, 5.12)])[-1]
    assert (last_mps == 5.12) is believed


def test_locked_wheels_do_not_stop_the_car():
    assert speeds([(0.995, 5.42), (1.035, 0.0)])[-1] > 5.2
