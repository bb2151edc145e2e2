"""The rules of a scan, for a driver that keeps one and writes into it."""

import numpy as np

from wallride.drivers.api import Scan
from wallride.drivers.scan_check import ScanCheck


def test_one_scan_that_is_written_anew_each_time_repeats_nothing():
    check, one = ScanCheck(), Scan(1.0, 1.0, -1.8, 0.03, 0.1, 10.0, np.ones(121, np.float32), 0)
    for number in range(4):
        one.stamp_s = one.received_s = 1.0 + number / 40
        one.sequence = number
        assert not check.fault(one, one.received_s)
    assert check.fault(one, one.received_s) == "repeats a scan"
