"""The car of a soak drives by the compiled functions where they are built, as on the road; the soak judges its wire."""

import pytest

from tests.compiled_laws import put_c_in_place


@pytest.fixture(autouse=True)
def _compiled(monkeypatch):
    put_c_in_place(monkeypatch)
