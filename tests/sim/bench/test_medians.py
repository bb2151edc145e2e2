"""Several runs into one."""

from wallride.sim.bench.measure import median_of


def test_every_number_becomes_its_median_wherever_it_stands():
    runs = [{"p50": 1.0, "rows": [{"lost": 0}], "name": "a"}, {"p50": 9.0, "rows": [{"lost": 4}], "name": "b"},
            {"p50": 2.0, "rows": [{"lost": 1}], "name": "c"}]  # fmt: skip
    assert median_of(runs) == {"p50": 2.0, "rows": [{"lost": 1}], "name": "a"}


def test_a_truth_is_what_most_runs_say():
    assert median_of([True, True, False]) is True
    assert median_of([True, False]) is False


def test_what_a_run_lacks_is_taken_from_the_others():
    assert median_of([{"p99": 3.0}, {}, {"p99": 5.0}]) == {"p99": 4.0}
