"""`wallride lab rooms`: how "free" and "resumed" are told, and a few rooms in which it must hold."""

from dataclasses import replace

import numpy as np
import pytest

from wallride.sim.lab import rooms
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.obstacles import ConstantMotion, Round, person
from wallride.sim.world.pose import CAR

PERIOD_S = 0.025


def cell(scenario, speed_mps=1.0, side="left"):
    return Cell("rooms", scenario, "ball+swept", speed_mps, 0.8, side, 1000)


def driven(pieces, *obstacles):
    """A run straight ahead with these speeds, (m/s, seconds) one after the other."""
    speed_mps = np.concatenate([np.full(round(seconds / PERIOD_S), mps) for mps, seconds in pieces])
    rows = speed_mps.size
    x_m = np.concatenate(([0.0], np.cumsum(speed_mps[:-1]) * PERIOD_S))
    pose, none = np.stack([x_m, np.zeros(rows), np.zeros(rows)], axis=1), np.zeros(rows)
    both = np.stack([speed_mps, speed_mps], axis=1)
    case = Case(world_of("straight", "left"), obstacles=obstacles)
    time_s = np.linspace(0.0, (rows - 1) * PERIOD_S, rows)
    return SimulatedRun(case, time_s, pose, both, both, both, none, none, none, none, 0.0, [], None, [])


LEAVES = person(2.5, 0.0, ConstantMotion(0.0, -1.0, 4.0))
"""In the way from 4 s on (before that not there), and 0.4 m aside, out of the strip, 0.4 s later."""


def test_the_way_is_free_when_nobody_is_in_the_strip():
    done = driven([(0.0, 6.0)], replace(LEAVES, appearance=replace(LEAVES.appearance, from_s=0.0)))
    far = rooms.way_free(done, LEAVES)
    assert far.all(), "2.5 m away is beyond the strip"
    near = driven([(1.0, 1.5), (0.0, 4.5)], LEAVES)
    free = rooms.way_free(near, LEAVES)
    first = np.flatnonzero(~free)[0] * PERIOD_S
    assert first == pytest.approx(2.5 - 0.2 - CAR.front_m - rooms.FREE_AHEAD_M, abs=0.03)
    again = (np.flatnonzero(~free)[-1] + 1) * PERIOD_S
    assert again == pytest.approx(4.0 + 0.2 + CAR.half_width_m + rooms.FREE_ASIDE_M, abs=0.03)


@pytest.mark.parametrize(
    ("pieces", "expected"),
    [
        (((1.0, 1.5), (0.0, 4.0), (0.5, 4.0)), (True, True, pytest.approx(5.5 - 4.4, abs=0.03))),
        (((1.0, 1.5), (0.0, 2.0), (-0.4, 0.5), (0.5, 5.0)), (True, True, 0.0)),
        (((1.0, 1.5), (0.0, 4.0), (0.5, 0.3), (0.0, 4.0)), (True, True, None)),
        (((1.0, 1.5), (0.0, 2.0)), (True, False, None)),
        (((1.0, 1.5), (0.2, 4.0)), (False, None, None)),
    ],
    ids=["goes on", "went round before", "only twitched", "never free", "never stood"],
)
def test_resuming_is_counted_from_the_moment_that_the_way_is_free(pieces, expected):
    told = rooms.resuming(driven(pieces, LEAVES), LEAVES)
    assert (told["stood"], told["freed"], told["resumed_after_s"]) == expected


def test_tries_are_beginnings():
    words = ["wall", "backing out, try 1 of 3", "backing out, try 1 of 3", "turning out, try 1 of 3", "boxed in"]
    assert rooms.tries(words) == 1
    assert rooms.tries([*words, "backing out, try 2 of 3"]) == 2


def test_persons_meet_the_car_where_the_names_say():
    for name, walker in rooms.WALKERS.items():
        thing = walker.obstacle(2.0)
        arrives_s = (rooms.AT_M - CAR.front_m) / 2.0
        at_m = rooms.walker_at(thing, np.array([arrives_s, 60.0]))
        assert isinstance(thing.shape, Round)
        match walker.name:
            case "crosses" | "stops in the way":
                assert at_m[:, 0] == pytest.approx([rooms.AT_M, 0.0], abs=1e-6), name
            case "stands, then leaves":
                assert at_m[:, 0] == pytest.approx([rooms.AT_M, 0.0]), name
                assert at_m[1, 1] < -10.0
            case "comes and passes":
                assert abs(at_m[1, 0]) > 0.5 + 0.05, name
            case "comes and stops":
                assert at_m[0, 1] > rooms.AT_M + rooms.COMES_SPARE_M, name
    stays = rooms.WALKERS["stops in the way at 2 m/s"].obstacle(1.0)
    assert rooms.walker_at(stays, np.array([60.0]))[1, 0] == pytest.approx(0.0)


def test_a_runner_before_a_fast_car_on_a_slippery_floor_cannot_be_avoided():
    runner = rooms.WALKERS["crosses at 3 m/s"]
    assert runner.avoidable(1.0, 0.8)
    assert not runner.avoidable(3.0, 0.2)


def test_every_column_that_needs_it_has_a_legend():
    row = {
        "law": "ball+swept", "kind": "clutter", "backs_out": True, "freed": True, "resumed_after_s": 2.0, "stood": True,
        "collided": False, "avoidable": True, "distance_m": 5.0, "tries": 1, "stuck": False, "last_words": "",
    }  # fmt: skip
    (table,) = rooms.tables([row])
    said = " ".join(table.notes)
    for name in ("touched", "avoidable", "stuck", "way m", "tries", "stood", "freed", "within 5 s", "latest s"):
        assert f"{name}" in said
        assert any(name in column for column in table.columns)


def test_there_are_enough_rooms():
    choice = CellChoice(("ball+swept",), (1.0, 2.0, 3.0, 4.0), (0.5, 0.8, 1.0), ("left", "right"), (1000,))
    cells = rooms.cells(choice)
    clutter = [made for made in cells if made.scenario.startswith(rooms.CLUTTER)]
    assert len([made for made in clutter if not made.scenario.endswith(rooms.WAITS)]) >= 24
    assert max(made.speed_mps for made in clutter) == 2.0
    assert max(made.speed_mps for made in cells) == 3.0


def test_waiting_forbids_backing_out():
    blocked = cell("stops in the way at 1 m/s, waits", 2.0)
    told = rooms.measure(blocked)
    assert (told["collided"], told["tries"], told["stuck"]) == (False, 0, True)
    assert told["last_words"] == "boxed in: needs help"
    assert told["freed"] is False


def test_the_car_goes_round_a_person_who_stays():
    told = rooms.measure(cell("stops in the way at 1 m/s", 2.0, "right"))
    assert not told["collided"]
    assert not told["stuck"]
    assert told["distance_m"] > 10.0


def test_driving_resumes_when_a_person_has_crossed():
    told = rooms.measure(cell("crosses at 1 m/s", 2.0))
    assert (told["collided"], told["stuck"]) == (False, False)
    assert told["resumed_after_s"] is None or told["resumed_after_s"] <= rooms.SOON_S
    assert told["distance_m"] > 10.0


def test_a_cluttered_room_is_not_touched_and_not_the_end(monkeypatch):
    monkeypatch.setattr(rooms, "CLUTTER_S", 20.0)
    told = rooms.measure(cell("cluttered room 2"))
    assert not told["collided"]
    assert told["distance_m"] > 12.0
