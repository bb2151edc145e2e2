"""What counts as traffic that may be behind the car: motion over a way and a time, not what jumps among furniture."""

from dataclasses import dataclass, field
from typing import Any

import pytest

from wallride.runtime.control.recovery.traffic import HIDDEN_S, MOVED_M, MOVED_S, SETTLED_S, Traffic

SCAN_S = 0.025


@dataclass
class Seen:
    """A track as far as traffic reads it."""

    place_m: complex = 0j
    seen_s: float = 0.0
    before: Any = field(default=None)


class Street:
    """A car's memory of one track, scan by scan."""

    def __init__(self, speed_mps: float = 2.0) -> None:
        self.traffic, self.track, self.now_s = Traffic(), Seen(), 10.0
        self.speed_mps = speed_mps

    def go(self, for_s: float, mps: float, *, moving_every: int = 1) -> None:
        """Let it go ahead in sight; only every nth scan shows that it moves."""
        for k in range(round(for_s / SCAN_S)):
            self.now_s += SCAN_S
            self.track.place_m += mps * SCAN_S
            self.track.seen_s = self.now_s
            moving: Any = [self.track] if mps and k % moving_every == 0 else []
            self.traffic.update(moving, self.now_s, speed_mps=self.speed_mps, stood=False)

    def hide(self, for_s: float) -> None:
        """Let time pass without a sight of it."""
        for _ in range(round(for_s / SCAN_S)):
            self.now_s += SCAN_S
            self.traffic.update([], self.now_s, speed_mps=self.speed_mps, stood=False)


def test_what_went_far_and_long_enough_is_traffic_until_it_stood():
    street = Street()
    street.go(MOVED_S + 2 * SCAN_S, 1.5)
    assert street.traffic.is_about
    street.go(SETTLED_S - 0.1, 0.0)
    assert street.traffic.is_about
    street.go(0.2, 0.0)
    assert not street.traffic.is_about


def test_a_slow_car_needs_no_time_to_tell_motion_from_its_own():
    street = Street(speed_mps=-0.4)
    street.go(MOVED_S / 2, 3.0)
    assert street.traffic.is_about


def test_what_jumped_before_a_fast_car_proves_nothing_to_it_once_it_is_slow():
    street = Street()
    street.go(MOVED_S - 2 * SCAN_S, 4.0)
    street.speed_mps = 0.2
    street.go(MOVED_S, 0.9 * MOVED_M)
    assert not street.traffic.is_about


def test_what_went_out_of_sight_may_be_behind_for_longer():
    street = Street()
    street.go(1.0, 1.5)
    street.hide(HIDDEN_S - 0.1)
    assert street.traffic.is_about
    street.hide(0.2)
    assert not street.traffic.is_about


@pytest.mark.parametrize(
    ("for_s", "mps", "every"),
    [
        (MOVED_S - 2 * SCAN_S, 4.0, 1),  # far, for a moment: the visible part of one thing jumps to the next
        (1.0, 4.0, 2),  # as far, with motion in one scan and not in the next
        (1.0, 0.9 * MOVED_M, 1),  # long, over no way: table legs in a bend
    ],
)
def test_what_only_seems_to_move_is_no_traffic(for_s, mps, every):
    street = Street()
    street.go(for_s, mps, moving_every=every)
    assert not street.traffic.is_about
    street.hide(1.0)
    assert not street.traffic.is_about
