"""A folder of the test's own, in which a command writes what it is not told to write elsewhere."""

import pytest


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path
