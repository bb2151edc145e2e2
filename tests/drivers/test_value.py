"""Values of the hot path: compared, hashed and copied like frozen dataclasses."""

from dataclasses import replace

from wallride.drivers.api import Drive
from wallride.drivers.value import value


@value(eq=False)
class Numbers:
    """Two of them."""

    first: float
    second: float = 2.0


def test_equal_values_are_equal_and_hash_alike():
    assert Drive(1.0, 0.1) == Drive(1.0, 0.1) != Drive(1.0, 0.2)
    assert len({Drive(1.0, 0.1), Drive(1.0, 0.1)}) == 1


def test_a_changed_copy_leaves_the_original():
    drive = Drive(1.0, 0.1)
    assert replace(drive, speed_mps=2.0) == Drive(2.0, 0.1)
    assert drive == Drive(1.0, 0.1)


def test_what_holds_arrays_is_itself_only():
    one = Numbers(1.0)
    assert one != Numbers(1.0)
    assert len({one, one, Numbers(1.0)}) == 2


def test_it_has_slots():
    assert not hasattr(Numbers(1.0), "__dict__")
