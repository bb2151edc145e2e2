"""The mutants that are said to be no faults are among those that are made."""

from benchmarks.mutants import EQUAL, TARGETS, mutants


def test_a_mutant_that_changes_nothing_is_found_by_its_words():
    explained = {words for words in EQUAL if words.startswith("runtime/control/limiter.py ")}
    assert len(explained) == 2
    assert explained <= {mutant.words for mutant in mutants(TARGETS["limiter"])}
