"""The encoded scans are what the real driver reads, and neighbours ask for different steering."""

import numpy as np
import pytest

from wallride.drivers.hokuyo.codec import ScipDeframer
from wallride.drivers.hokuyo.ranges import RangeDecoder
from wallride.drivers.hokuyo.replies import decode_number
from wallride.sim.bench.course import BOARD_AHEAD_M, make_course, sensor

ECHO = b"MD0000108000000"


@pytest.fixture(scope="module")
def course():
    return make_course(scans=8)


def test_the_driver_reads_every_range_to_the_millimetre(course):
    for i, picture in enumerate((*course.free, *course.blocked)):
        (block,) = ScipDeframer().feed(picture.block(ECHO, 25 * i + (1 << 24)))
        assert decode_number(block.lines[0]) == 25 * i
        decoded_m = RangeDecoder(1081, 20, 30000).decode(block.lines[1])
        assert decoded_m is not None
        sent_mm = course.ranges_mm[i].astype(float)
        sent_mm[(sent_mm < 20) | (sent_mm > 30000)] = np.nan
        np.testing.assert_allclose(decoded_m * 1000, sent_mm, atol=0.01)


def test_a_board_stands_before_the_car_in_the_blocked_ones_only(course):
    ahead_mm = course.ranges_mm[:, 540]
    assert (ahead_mm[:8] > 1500).all()
    assert (ahead_mm[8:] == 1000 * BOARD_AHEAD_M).all()


def test_neighbours_stand_apart(course):
    left_mm = course.ranges_mm[:8, 900].astype(int)
    assert (np.abs(np.diff(left_mm)) > 25).all()


@pytest.mark.parametrize("beams", [361, 1081, 4321])
def test_a_sensor_of_any_size_looks_straight_ahead(beams):
    model = sensor(beams, 40.0)
    assert model.beam_count == beams
    assert (model.front_step - model.first_step) * 360 / model.steps_per_turn == pytest.approx(135)


def test_a_number_of_beams_without_a_middle_is_refused():
    with pytest.raises(ValueError, match="multiple of 6"):
        sensor(1080, 40.0)
