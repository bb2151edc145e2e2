"""The battery's cells, and when its voltage slows the car down, stops it, and lets it go again."""

from dataclasses import replace

import pytest
from pydantic import ValidationError

from wallride.drivers.api import MotorState
from wallride.runtime.control.battery import LASTS_S, LOADED_ABOVE_A, BatteryMonitor, BatterySettings, Charge

REPORT = MotorState(0.0, 0.0, 0.0, 0.0, 12.0, 0.0, 0.0)
FREE = float("inf")
PERIOD_S = 0.05


class Pack:
    """A pack whose voltage is reported 20 times a second."""

    def __init__(self, **settings):
        self.monitor = BatteryMonitor(BatterySettings(**settings))
        self.now_s = 100.0

    def shows(self, voltage_v, seconds, current_a=0.5):
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.monitor.update(replace(REPORT, stamp_s=self.now_s, voltage_v=voltage_v, input_current_a=current_a))
        return self.monitor


@pytest.mark.parametrize(
    ("voltage_v", "cells"), [(7.0, 2), (8.4, 2), (9.6, 3), (11.1, 3), (12.6, 3), (14.0, 4), (16.8, 4), (25.2, 6)]
)
def test_the_cells_are_the_fewest_that_give_the_voltage(voltage_v, cells):
    assert Pack().shows(voltage_v, 0.1).cells == cells
    assert Pack(cells=5).shows(voltage_v, 0.1).cells == 5


def test_nothing_moves_before_two_seconds_of_good_voltage():
    pack = Pack()
    assert pack.shows(11.8, 1.9).limit_mps == 0.0
    assert pack.monitor.charge is Charge.UNKNOWN
    pack.shows(9.0, 0.1)  # a dip: from the beginning
    assert pack.shows(11.8, 1.9).limit_mps == 0.0
    assert pack.shows(11.8, 0.2).limit_mps == FREE
    assert pack.monitor.trouble == ""


def test_a_start_on_a_low_battery_says_so_and_does_not_move():
    assert Pack().shows(10.0, 3.0).trouble == "battery low: 10.0 V; charge or change it"
    assert Pack().shows(10.0, 3.0).limit_mps == 0.0


def test_a_low_voltage_limits_after_a_second_and_an_empty_one_stops_with_words_of_its_own():
    pack = Pack()
    pack.shows(11.8, 3.0)
    assert pack.shows(10.1, LASTS_S - 0.1).limit_mps == FREE, "the motor's start is a dip"
    assert pack.shows(10.1, 0.2).limit_mps == 1.0
    words = pack.monitor.trouble
    assert words == "battery low: 10.1 V; charge or change it"
    assert pack.shows(10.0, 2.0).trouble == words, "constant words: a change of words is an event"
    assert pack.shows(9.5, LASTS_S + 0.1).limit_mps == 0.0
    assert pack.monitor.trouble == "battery empty: 9.5 V; charge or change it"


def test_a_dip_of_a_start_changes_nothing():
    pack = Pack()
    pack.shows(11.8, 3.0)
    for _ in range(5):
        pack.shows(7.0, 0.4)
        assert pack.shows(11.5, 0.1).charge is Charge.GOOD


def test_a_stopped_car_whose_battery_recovers_a_little_stays_stopped():
    pack = Pack()
    pack.shows(11.8, 3.0)
    pack.shows(9.4, 1.2)
    assert pack.shows(10.4, 60.0).charge is Charge.EMPTY
    assert pack.shows(11.9, 1.9).limit_mps == 0.0
    assert pack.shows(11.9, 0.2).limit_mps == FREE


def test_without_a_battery_it_says_so():
    assert Pack().shows(0.4, 1.2).trouble == "no battery: 0.4 V; plug it in, release its switch"


def test_another_pack_after_a_lost_controller_is_judged_anew():
    pack = Pack()
    pack.shows(11.8, 3.0)
    pack.monitor.update(None)
    assert (pack.monitor.limit_mps, pack.monitor.cells) == (0.0, 0)
    assert pack.shows(7.8, 2.1).cells == 2
    assert pack.monitor.charge is Charge.GOOD


def test_the_lowest_voltage_under_load_is_kept():
    pack = Pack()
    pack.shows(11.0, 0.5)
    assert pack.monitor.sag_v != pack.monitor.sag_v
    pack.shows(10.9, 0.1, current_a=20.0)
    pack.shows(10.2, 0.1, current_a=-30.0)
    pack.shows(9.0, 0.1)
    assert pack.shows(10.8, 0.1, current_a=20.0).sag_v == 10.2


EXACT = {"cells": 2, "low_v_per_cell": 3.5, "cutoff_v_per_cell": 3.0}
"""Limits, and a period below, that floating point represents exactly."""


def at_most(pack, voltage_v, charge):
    """Return the time from the first report of this voltage to this charge."""
    for report in range(100):
        pack.now_s += 0.25
        pack.monitor.update(replace(REPORT, stamp_s=pack.now_s, voltage_v=voltage_v))
        if pack.monitor.charge is charge:
            return report * 0.25
    return float("inf")


def test_each_limit_itself_is_still_good_and_each_time_itself_is_enough():
    pack = Pack(**EXACT)
    assert at_most(pack, 7.0, Charge.LOW) == float("inf")
    pack = Pack(**EXACT)
    assert at_most(pack, 7.0, Charge.GOOD) == 2.0
    assert at_most(pack, 6.0, Charge.LOW) == 1.0
    assert at_most(pack, 6.0, Charge.EMPTY) == float("inf")
    assert at_most(pack, 5.75, Charge.EMPTY) == 1.0
    assert at_most(pack, 7.25, Charge.GOOD) == 2.0


def test_a_pack_is_one_from_six_volts_on():
    pack = Pack(low_v_per_cell=3.2)
    assert pack.monitor.fields()["cells"] is None
    assert at_most(pack, 6.0, Charge.EMPTY) == 1.0
    assert pack.monitor.fields()["cells"] == 2
    assert pack.monitor.trouble == "battery empty: 6.0 V; charge or change it"


def test_without_a_check_a_low_battery_still_counts_after_a_second():
    pack = Pack(**EXACT, settle_s=0)
    assert pack.monitor.charge is Charge.GOOD
    assert at_most(pack, 6.5, Charge.LOW) == 1.0
    assert pack.monitor.limit_mps == 1.0
    pack.monitor.update(None)
    assert (pack.monitor.charge, pack.monitor.limit_mps, pack.monitor.trouble) == (Charge.GOOD, FREE, "")


def test_a_lost_controller_begins_everything_anew():
    pack = Pack()
    pack.shows(11.8, 1.9, current_a=LOADED_ABOVE_A)
    assert pack.monitor.sag_v == 11.8
    pack.monitor.update(None)
    assert pack.monitor.sag_v != pack.monitor.sag_v
    assert pack.monitor.voltage_v != pack.monitor.voltage_v
    assert pack.shows(11.8, 0.5).limit_mps == 0.0
    assert pack.shows(11.8, 1.6).limit_mps == FREE


def test_the_same_limit_twice_is_a_stop_without_slowing_down():
    assert BatterySettings(low_v_per_cell=3.2).cutoff_v_per_cell == 3.2
    with pytest.raises(ValidationError):
        BatterySettings.model_validate({"cells": True})


def test_limits_in_the_wrong_order_are_refused():
    with pytest.raises(ValidationError, match="slows down first"):
        BatterySettings(low_v_per_cell=3.0, cutoff_v_per_cell=3.2)
