"""`lab rooms --generated` and `lab laps --generated`: what is run, what is told, and that nothing is touched."""

import json
from functools import partial

import numpy as np
import pytest

from tests.sim.lab.test_rooms import driven
from tests.typed import typed
from wallride.sim.lab import generated_rooms, laps
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.lab.command import run

options = partial(typed, "lab")


@pytest.mark.parametrize(
    ("pieces", "expected"),
    [
        ([(1.0, 4.0)], []),
        ([(0.0, 1.0), (1.0, 4.0)], []),  # a start is no stand
        ([(1.0, 2.0), (0.0, 0.3), (1.0, 2.0)], []),  # nor is a change of direction
        ([(1.0, 2.0), (0.0, 3.0), (-0.4, 1.0), (0.0, 0.6), (0.5, 4.0)], [3.0 + 1.0 + 0.6 + 2.8]),
        ([(1.0, 2.0), (0.0, 3.0), (1.0, 2.0), (0.0, 5.0)], [4.0]),  # the last one lasts
    ],
)
def test_how_long_a_car_stood_until_it_was_away(pieces, expected):
    assert generated_rooms.stood_until_on_s(driven(pieces)) == pytest.approx(expected, abs=0.06)


def test_a_narrow_loop_on_a_slippery_floor_is_driven_without_a_touch():
    """Bends at full lock that leave a few centimetres: the rollouts have to turn as wide as the car does, and a brake
    in the bend has to last until it is known to pass."""
    cell = Cell("generated_rooms", "generated", "ball", 2.0, 0.5, "right", 1550)
    assert not generated_rooms.measure(cell)["collided"]


def test_a_generated_room_is_driven_without_a_touch_and_told(tmp_path, capsys):
    file = tmp_path / "rooms.json"
    asked = ["--seeds", "2:3", "--speeds", "2,4", "--mu", ".8", "--side", "left", "--jobs", "1"]
    assert run(options("rooms", "--generated", *asked, "--json", str(file))) == 0
    (cell,) = json.loads(file.read_text())["cells"]
    assert (cell["seed"], cell["speed_mps"], cell["kind"]) == (2, 2.0, "blind end")
    assert not cell["collided"]
    assert not cell["stuck"]
    assert cell["tries"] > 0
    assert "stands though a way" in capsys.readouterr().out


def test_where_no_way_exists_the_car_stays_and_asks_for_help():
    figures = generated_rooms.measure(Cell("generated_rooms", "generated", "ball+swept", 1.0, 0.8, "right", 18))
    assert figures["kind"] == "closed"
    assert figures["stuck"]
    assert not figures["way_exists"]
    assert not figures["collided"]
    assert figures["tries"] == 0
    assert "boxed in" in figures["last_words"]


def test_generated_laps_are_run_on_both_walls_of_a_seeds_track():
    choice = CellChoice(("ball+swept",), (1.0,), (0.8,), ("left", "right"), (3, 4), generated=True)
    cells = laps.cells(choice)
    assert {(cell.scenario, cell.side, cell.seed) for cell in cells} == {
        (name, side, seed) for name in laps.GENERATED for side in ("left", "right") for seed in (3, 4)
    }
    outer, inner = (laps.load_lap_world(name, "left", 3) for name in laps.GENERATED)
    assert abs(np.cos(outer.start.yaw_rad - inner.start.yaw_rad) + 1.0) < 1e-9, "the other way round"


@pytest.mark.parametrize("seeds", ["5:5", "7:3", "-1:4", "x", "1:y", "0"])
def test_seeds_that_make_no_sense_are_refused(seeds, capsys):
    assert run(options("rooms", "--generated", f"--seeds={seeds}")) == 2
    assert "--seeds" in capsys.readouterr().err
