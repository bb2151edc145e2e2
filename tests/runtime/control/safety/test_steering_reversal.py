"""Who has turned round from one scan to the next, and may turn back."""

import pytest

from wallride.runtime.control.safety.steering_reversal import SteeringReversal

JUMP_RAD = 0.2


class Driver:
    """Wishes, one every 25 ms."""

    def __init__(self):
        self.reversal = SteeringReversal()
        self.now_s = 100.0

    def wishes(self, *steering_rad):
        for one_rad in steering_rad:
            self.now_s += 0.025
            self.reversal = self.reversal.after(one_rad, self.now_s, JUMP_RAD)
        return self.reversal.given_up_rad if self.reversal.wavers else None


@pytest.mark.parametrize("sign", [1, -1])
def test_the_side_that_was_given_up_counts_for_a_moment(sign):
    driver = Driver()
    assert driver.wishes(*[sign * 0.3] * 5) is None
    assert driver.wishes(*[-sign * 0.2] * 12) == sign * 0.3
    assert driver.wishes(-sign * 0.2) is None


def test_turning_back_is_no_other_side():
    driver = Driver()
    driver.wishes(*[0.3] * 5)
    assert driver.wishes(-0.2) == 0.3
    assert driver.wishes(0.3) is None
    assert driver.wishes(-0.2) == 0.3  # and for as long as it was in doubt it is so again


def test_steering_is_no_wavering():
    for wishes in (
        [0.3] * 5 + [0.0, -0.3],  # straight on in between
        [0.05] * 5 + [-0.1],  # as much as the wheels follow
        [0.34] * 5 + [0.05],  # the same side
        [0.0] * 5 + [-0.34],  # a corner comes in view
    ):
        assert Driver().wishes(*wishes) is None


def test_a_wish_of_one_scan_was_an_error():
    driver = Driver()
    driver.wishes(*[0.3] * 5, -0.3)
    assert driver.wishes(0.3) is None


def test_a_driver_who_comes_back_after_a_while_is_a_new_one():
    driver = Driver()
    driver.wishes(*[0.3] * 5)
    driver.now_s += 0.5
    assert driver.wishes(-0.3) is None
