"""A fingerprint changes with what a function does, through everything of ours that it calls, and with nothing else."""

import pytest

from wallride.drivers.fingerprint import Sources

LAW = '''"""A law."""
from math import sin

from room import other
from room.helper import LIMIT_M, Shape, halve, unused

GAIN = 2.0
"""Handed to C."""
TABLE = tuple(range(3))


@accelerated
def law(error_m: float) -> float:
    """Return it."""
    return GAIN * halve(error_m) + other.turn(LIMIT_M) + sin(TABLE[1])


def asked(shape: Shape, gain=1):
    return shape.area() * gain


def neighbour():
    return 1
'''
HELPER = """
LIMIT_M = 1.0


class Shape:
    size = 1

    def area(self):
        return self.size**2


def halve(value):
    return value / 2


def unused(value):
    return value
"""
OTHER = """
def turn(value):
    return _inner(value)


def _inner(value):
    return -value


def alone(value):
    return value
"""


@pytest.fixture
def sources(tmp_path):
    room = tmp_path / "room"
    room.mkdir()
    texts = {"law": LAW, "helper": HELPER, "other": OTHER}

    def of(**edits):
        for name, text in texts.items():
            old, new = edits.get(name, ("", ""))
            assert old in text
            (room / f"{name}.py").write_text(text.replace(old, new, 1) if old else text)
        return Sources(tmp_path, frozenset({"room.law.GAIN", "room.helper.LIMIT_M"})).fingerprint("room.law", "law")

    return of


@pytest.mark.parametrize(
    "edit",
    [
        {"law": ("    return GAIN", "    # a comment\n\n    return GAIN")},
        {"law": ("Return it.", "Return the answer.")},
        {"law": ("error_m: float) -> float", "error_m)")},
        {"law": ("GAIN = 2.0", "GAIN = 3.0")},
        {"law": ("return 1", "return 2")},
        {"helper": ("LIMIT_M = 1.0", "LIMIT_M = 2.0")},
        {"helper": ("return value\n", "return -value\n")},
        {"helper": ("size = 1", "size = 2")},
        {"other": ("def alone(value):\n    return value", "def alone(value):\n    return 0")},
    ],
)
def test_what_does_not_decide_costs_nothing(sources, edit):
    assert sources(**edit).digest == sources().digest


@pytest.mark.parametrize(
    "edit",
    [
        {"law": ("GAIN * halve", "GAIN + halve")},
        {"law": ("TABLE[1]", "TABLE[2]")},
        {"law": ("range(3)", "range(4)")},
        {"helper": ("value / 2", "value / 3")},
        {"helper": ("value / 2", "value // 2")},
        {"other": ("-value", "+value")},
        {"other": ("_inner(value)\n\n", "_inner(2 * value)\n\n")},
    ],
)
def test_what_decides_changes_it_through_all_that_is_called(sources, edit):
    assert sources(**edit).digest != sources().digest


def test_the_methods_of_its_parameters_count_and_their_fields_do_not(sources, tmp_path):
    def asked(**edits):
        sources(**edits)
        return Sources(tmp_path).fingerprint("room.law", "asked").digest

    assert asked(helper=("size = 1", "size = 2")) == asked()
    assert asked(helper=("self.size**2", "self.size**3")) != asked()


def test_it_names_the_modules_and_the_constants_that_it_depends_on(sources):
    found = sources()
    assert found.modules == ("room.helper", "room.law", "room.other")
    assert found.constants == ("room.helper.LIMIT_M", "room.law.GAIN")


def test_a_parameter_with_the_name_of_a_function_is_not_that_function(sources):
    shadowed = {"law": ("error_m: float) -> float", "halve, turned=None)")}
    assert "room.helper" in sources(**shadowed).modules, "with a default, the name may be the function"
    shadowed = {"law": ("def law(error_m: float)", "def law(halve)")}
    changed = {"helper": ("value / 2", "value / 3")}
    assert sources(**shadowed, **changed).digest == sources(**shadowed).digest


def test_a_function_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(KeyError, match=r"room\.law"):
        Sources(tmp_path).fingerprint("room.law", "law")
