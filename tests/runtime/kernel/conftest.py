"""The twins, and a place where they answer beside the Python."""

import shutil
import sysconfig
from collections import Counter
from pathlib import Path

import pytest

from drivers import twin
from runtime import kernel
from tests.runtime.kernel.sameness import assert_same

HEADER = Path(sysconfig.get_paths()["include"]) / "Python.h"


@pytest.fixture(scope="module")
def compiled():
    """Return the twins; the Python goes on answering."""
    found = kernel.use()
    answering = dict(twin._answering)
    twin.use({})
    if not found.functions:
        assert shutil.which("cc") is None or not HEADER.is_file(), found.words  # it could be had, and is broken
        pytest.skip(found.words)
    return {name: answering[name] for name in found.functions}


@pytest.fixture
def compared(compiled):
    """Let both answer everything, and compare; counts how often each was asked."""
    asked = Counter()

    def both(name):
        def answer(*given):
            by_python = twin.PLAIN[name](*given)
            asked[name] += 1
            assert_same(name, by_python, compiled[name](*given))
            return by_python

        return answer

    twin.use({name: both(name) for name in compiled})
    yield asked
    twin.use({})


@pytest.fixture
def as_it_was():
    yield
    twin.use({})
