"""`submit`: every cell once, whatever becomes of its worker."""

import multiprocessing

import pytest

from tests.sim.lab.workers.works import DiesAtStart, KilledAtStart, dies, double, slowly, where
from wallride.sim.lab.workers.finished_cell import WorkerStartError
from wallride.sim.lab.workers.submit import submit, workers


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_cell_ends_once_and_a_failing_one_is_a_result(jobs):
    ended = list(submit([3, -1, 4, 5], double, jobs=jobs))
    assert sorted(done.index for done in ended) == [0, 1, 2, 3]
    by_cell = {done.cell: done for done in ended}
    assert {cell: done.figures for cell, done in by_cell.items()} == {
        3: {"twice": 6}, -1: None, 4: {"twice": 8}, 5: {"twice": 10},
    }  # fmt: skip
    assert by_cell[-1].error.startswith("ValueError: -1 is below zero (works.py:")
    assert by_cell[3].error == ""


def test_a_killed_worker_costs_its_cell_which_is_run_again(tmp_path):
    cells = [(1, ""), (2, str(tmp_path / "once")), (3, ""), (4, "always"), *((number, "") for number in range(5, 25))]
    ended = {done.cell[0]: done for done in submit(cells, dies, jobs=2)}
    assert sorted(ended) == sorted(number for number, _ in cells)
    assert ended[2].figures == {"twice": 4}
    assert ended[4].figures is None
    assert ended[4].error == "its worker process was ended by signal 9, 2 times"
    assert all(done.figures == {"twice": 2 * number} for number, done in ended.items() if number != 4)


def test_an_abandoned_run_leaves_no_process():
    before = set(multiprocessing.active_children())
    ends = submit(list(range(50)), slowly, jobs=2)
    assert next(ends).figures is not None
    assert set(multiprocessing.active_children()) > before
    ends.close()
    assert set(multiprocessing.active_children()) == before


def test_workers_that_cannot_start_are_told_and_not_started_for_ever():
    with pytest.raises(WorkerStartError, match="ended with exit code 7 before its first cell"):
        list(submit(list(range(50)), DiesAtStart(), jobs=2))


def test_a_worker_that_is_killed_before_its_first_cell_is_replaced_once(tmp_path):
    ended = list(submit(list(range(12)), KilledAtStart(tmp_path, 1), jobs=2))
    assert sorted((done.figures or {})["twice"] for done in ended) == list(range(0, 24, 2))
    (tmp_path / "more").mkdir()
    with pytest.raises(WorkerStartError, match="was ended by signal 9 before its first cell"):
        list(submit(list(range(12)), KilledAtStart(tmp_path / "more", 9), jobs=2))


def test_nothing_to_do_is_done():
    assert list(submit([], double, jobs=2)) == []


def test_workers_stay_from_one_call_to_the_next_and_go_at_the_end():
    before = set(multiprocessing.active_children())
    with workers(where, jobs=2) as run:
        at_work = set[int]()
        while len(at_work) < 2:  # both have started
            at_work |= {(end.figures or {})["pid"] for end in run(range(4))}
        there = set(multiprocessing.active_children()) - before
        assert {process.pid for process in there} == at_work
        for process in there:
            process.kill()
            process.join()
        after = [(end.figures or {})["pid"] for end in run(range(4))]
        assert len(after) == 4
        assert not at_work & set(after)
    assert set(multiprocessing.active_children()) == before


def test_what_an_abandoned_call_had_begun_answers_no_later_one():
    with workers(slowly, jobs=2) as run:
        ends = run(list(range(50)))
        next(ends)
        ends.close()
        assert sorted(end.cell for end in run([100, 101, 102])) == [100, 101, 102]
