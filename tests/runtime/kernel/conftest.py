"""The C functions, and a place where they answer beside the Python."""

import os
import shutil
from collections import Counter

import pytest

from tests.compiled_laws import import_laws, put_in_place
from tests.runtime.kernel.sameness import assert_same
from wallride.drivers import accelerated
from wallride.drivers.accelerated import FUNCTIONS, UnfitError


@pytest.fixture(scope="session")
def compiled():
    """Return the C functions by name, as C takes its arguments; the Python goes on answering."""
    try:
        import_laws()
    except UnfitError as reason:
        if shutil.which(os.environ.get("CC", "cc")) is not None:
            pytest.fail(f"{reason}: make .venv/.kernel, or wallride build-kernel")
        pytest.skip(str(reason))
    for one in FUNCTIONS.values():
        one.compiled()
    return {name: getattr(accelerated.extension(), name) for name in FUNCTIONS}


@pytest.fixture
def compared(compiled, monkeypatch):
    """Let both answer everything, and compare; counts how often each was asked."""
    asked = Counter()

    def both(name):
        by_c = FUNCTIONS[name].compiled()

        def answer(*given):
            by_python = FUNCTIONS[name].python(*given)
            asked[name] += 1
            assert_same(name, by_python, by_c(*given))
            return by_python

        return answer

    put_in_place(monkeypatch, {name: both(name) for name in FUNCTIONS})
    return asked
