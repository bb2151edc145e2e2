"""A furnished ring to be located in."""

import pytest

from tests.runtime.control.localization.rooms import BOXES, ring
from wallride.runtime.control.localization.line_field import field_of_cells


@pytest.fixture(scope="module")
def room():
    return ring(BOXES)


@pytest.fixture(scope="module")
def field(room):
    return field_of_cells(room.cells)
