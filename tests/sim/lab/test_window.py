"""`wallride lab window`: dirt is found within 7 m, and none is imagined; a few of its cells."""

import numpy as np
import pytest

from wallride.sim.lab import window
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.world.beams import LidarSettings


def cell(scenario, speed_mps=2.0, side="left"):
    return Cell("window", scenario, "ball+swept", speed_mps, 0.8, side, 77)


def test_the_plan_has_48_clean_runs():
    choice = CellChoice(("ball+swept",), (1.0, 2.0, 3.0, 4.0), (0.8,), ("left", "right"), (77,))
    assert sum(made.scenario.startswith("clean") for made in window.cells(choice)) == 48


def test_truly_dirty_are_the_beams_of_the_sectors_mirrored_with_the_wall():
    lidar = LidarSettings()
    left = window.truly_dirty(window.sectors("one smudge, loop", "left"), lidar)
    right = window.truly_dirty(window.sectors("one smudge, loop", "right"), lidar)
    assert np.count_nonzero(left) == 12
    assert (left == right[::-1]).all()


@pytest.mark.parametrize("scenario", ["one smudge, loop", "two ahead, curved", "as on a real car, u_turn"])
def test_dirt_is_found(scenario):
    figures = window.measure(cell(scenario))
    assert figures["found_share"] >= window.FOUND_SHARE
    assert figures["found_after_m"] < 3.0
    assert figures["false_beams"] == 0
    assert figures["safety_stops"] == 0
    assert not figures["collided"]


@pytest.mark.parametrize(("scenario", "side"), [("clean, inside_corner", "left"), ("clean, doorway", "right")])
def test_a_clean_window_is_not_blamed(scenario, side):
    figures = window.measure(cell(scenario, 1.0, side))
    assert figures["false_beams"] == 0
    assert figures["words"] == []


def test_the_table_says_both_shares():
    rows = [
        made.named(window.measure(made)) for made in (cell("clean, straight", 4.0), cell("one smudge, straight", 4.0))
    ]
    (table,) = window.tables(rows)
    assert [row[0] for row in table.rows] == ["clean", "one smudge"]
    assert "100.0 % of dirty beams" in table.notes[0]
    assert "0 of 1 clean runs" in table.notes[0]
