"""What safety once failed at, driven again: nothing is touched while the car moves."""

import pytest

from wallride.sim.lab import hazards
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.laws import check


def measure(scenario, speed_mps, mu, side="left", seed=0, own_parts="none"):
    return hazards.measure(Cell("hazards", scenario, check("ball"), speed_mps, mu, side, seed, own_parts=own_parts))


@pytest.mark.parametrize(
    ("scenario", "speed_mps", "mu"),
    [
        ("pole 2 cm at the edge", 4.0, 0.5),  # three beams meet it too late
        ("corner cut", 4.0, 0.5),  # gaining speed in a bend carried the car out of it
        ("bend into a pole", 3.0, 0.8),  # noise at the strip's edge let it go again and again
        ("chair legs", 4.0, 0.5),
        ("person crosses", 4.0, 0.8),
    ],
)
def test_hazards_are_not_touched(scenario, speed_mps, mu):
    for side in ("left", "right"):
        assert not measure(scenario, speed_mps, mu, side)["collided"]


@pytest.mark.parametrize("scenario", ["person comes", "person comes at the edge"])
@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 4.0])
def test_a_person_who_walks_at_the_car_finds_it_standing(scenario, speed_mps):
    assert not measure(scenario, speed_mps, 0.5)["collided"]


@pytest.mark.parametrize("mu", [0.5, 0.8])
def test_the_steep_start_beside_a_wall_is_driven_without_contact(mu):
    """0.5 m from the wall, 20 degrees toward it, 3 m/s: full braking hits it on the worse floor."""
    assert not measure("normal t1", 3.0, mu)["collided"]


def test_a_car_that_braked_with_locked_wheels_does_not_set_off_at_the_person_who_walks_up_to_it():
    """Until the wheels grip again no motion is told; released by then, it met him at 0.45 m/s."""
    done = measure("person crosses", 4.0, 0.5, seed=8101, own_parts="film")
    assert done["safety_stops"] == 1
    assert not done["collided"]
