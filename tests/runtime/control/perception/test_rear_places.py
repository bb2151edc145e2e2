"""Places that no rear beam can meet are left out before they are looked for, and no other."""

import math

import numpy as np
import pytest

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.own_parts import rear_of
from wallride.runtime.control.perception.rear_places import expected_m, polar, seen_again
from wallride.runtime.control.perception.view import DOUBTED_NEARER_THAN_M, ViewCache
from wallride.runtime.control.vehicle import CarSettings


@pytest.mark.parametrize("step_deg", [0.25, 1.0, 4.0, 30.0])
def test_the_places_that_are_left_out_change_nothing_behind_the_shoulders(step_deg):
    rng, step_rad = np.random.default_rng(1), math.radians(step_deg)
    beams = math.floor(270 / step_deg) + 1
    ranges_m = rng.uniform(0.2, DOUBTED_NEARER_THAN_M, beams).astype(np.float32)
    scan = Scan(0.0, 0.0, -step_rad * (beams // 2), step_rad, 0.02, 30.0, ranges_m, 0)
    view = ViewCache(CarSettings()).see(scan)
    rear = rear_of(view)
    left_out = 0
    for _ in range(2000):
        places = rng.uniform(-1.3, 1.3, 2) + 1j * rng.uniform(-1.3, 1.3, 2)
        every, few = (polar(places, 0.1 + 0.2j, 0.6 + 0.8j, to_x_m, scan) for to_x_m in (math.inf, rear.to_x_m))
        left_out += every[0].size - few[0].size
        due_m = [expected_m(beams, *some)[rear.beams] for some in (every, few)]
        again = [seen_again(view.ranges_m, rear.beams, *some) for some in (every, few)]
        assert np.array_equal(due_m[0], due_m[1])
        assert np.array_equal(again[0], again[1])
    assert left_out or step_deg == 30.0
