"""Whole drives: the laws answer in C, as they do for a user."""

import pytest

from tests.compiled_laws import put_c_in_place


@pytest.fixture(autouse=True)
def the_laws_answer_in_c(monkeypatch):
    put_c_in_place(monkeypatch)
