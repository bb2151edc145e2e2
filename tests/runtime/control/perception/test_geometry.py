"""The median and the quantiles are numpy's, without what numpy imports for them."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from wallride.runtime.control.perception.geometry import median, quantile

FIRST_CALLS = """
import sys, time
import numpy as np
from wallride.runtime import launch, rehearsal
from wallride.runtime.control.perception.geometry import median, quantile
from wallride.runtime.settings.tree import Settings
rehearsal.Rehearsal(Settings(), time.monotonic).warm_up()
median(np.ones(4)), quantile(np.ones(4), 0.1)
print(*{"numpy.ma", "numpy.random"} & {*sys.modules})
"""

CONTROL = Path(__file__).parents[4] / "runtime/control"
IMPORTS_MASKED_ARRAYS = re.compile(r"np\.(?:nan)?(?:median|percentile|quantile)\(|np\.unique\((?!.*return_)")


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_median_and_quantiles_are_those_of_numpy(kind):
    rng = np.random.default_rng(1)
    for size in [*range(1, 40), 300, 301]:
        values = rng.uniform(0.0, 30.0, size).astype(kind)
        assert median(values) == np.median(values)
        for share in (0.1, 0.5, 0.9):
            assert quantile(values, share) == np.percentile(values, 100 * share)


def test_a_car_imports_neither_masked_arrays_nor_random_numbers():
    found = subprocess.run([sys.executable, "-c", FIRST_CALLS], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_no_law_calls_what_imports_masked_arrays_in_the_middle_of_a_drive():
    files = sorted(CONTROL.rglob("*.py"))
    assert len(files) > 50
    assert [str(file) for file in files if IMPORTS_MASKED_ARRAYS.search(file.read_text())] == []
