"""A status at every scan of a hand-over changes no decision; the full run: `python -m benchmarks.hand_overs`."""

import pytest

from benchmarks.hand_overs import HandOver, differing
from tests.tiers import slow


@pytest.mark.parametrize("seed", [17, *slow(38, 49, 57)])
def test_a_status_changes_no_decision_of_a_hand_over(seed):
    """The seeds: of drives that differed while the status shared the emergency with the judgements."""
    assert differing(HandOver.random(seed)) == []
