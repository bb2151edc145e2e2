"""A car under a flood goes on: it drives, another operator's e-stop stops it, and its memory stays.

The figures are those of `python -m tests.system.floods`; here is only what holds on any machine.
"""

import math

import pytest

from tests.system.floods import flooded

MAX_GROWN_BYTES = 20_000_000


@pytest.mark.timeout(120)
@pytest.mark.parametrize("flood", ["nonsense:alice+large_questions:bob+stranger:nobody", "wild:here"])
async def test_in_a_flood_the_e_stop_of_another_operator_stops_the_car(flood):
    figures = await flooded(flood, seconds=1.0)
    assert all(int(count) > 0 for count in figures.sent.split()), figures.sent
    assert math.isfinite(figures.stop_s)
    assert figures.grown_bytes < MAX_GROWN_BYTES
