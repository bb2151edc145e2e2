"""The speed of a scan: the wheels', by the time between their reports, and the car's own while they are locked."""

import numpy as np
import pytest

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.safety.swept import assumed
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings

STEP_RAD = np.radians(0.25)
RANGES_M = np.full(1081, 9.0, np.float32)


def speeds(reports):
    """Return the speed at each scan; reports: stamp and speed of the wheels' newest one at each, 25 ms apart."""
    perception, found = Perception(CarSettings(), assumed(SweptSettings())), []
    for number, (stamp_s, speed_mps) in enumerate(reports):
        now_s = 1.0 + 0.025 * number
        scan = Scan(now_s, now_s, -540 * STEP_RAD, STEP_RAD, 0.02, 30.0, RANGES_M, number)
        found.append(perception.look(scan, MotorState(stamp_s, speed_mps, 0.0, 0.0)).speed_mps)
    return found


@pytest.mark.parametrize(("report_s", "believed"), [(1.035, True), (1.015, False)])
def test_a_fall_between_two_scans_is_that_of_the_time_between_the_reports(report_s, believed):
    """At 50 reports and 40 scans a second, two of them come between two scans at times."""
    last_mps = speeds([(0.995, 5.42), (report_s, 5.12)])[-1]
    assert (last_mps == 5.12) is believed


def test_locked_wheels_do_not_stop_the_car():
    assert speeds([(0.995, 5.42), (1.035, 0.0)])[-1] > 5.2
