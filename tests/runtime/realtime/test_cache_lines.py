"""Everything that a call needs is found, and each of its cache lines once."""

import sys

import numpy as np
import pytest

from runtime.realtime.cache_lines import HEADER_BYTES, LINE_BYTES, MAX_BYTES, Call, addresses, called, held


class Base:
    """Has what another inherits."""

    def inherited(self):
        return self

    @property
    def computed(self):
        return 0.25


class Derived(Base):
    """Has methods."""

    number: object

    def own(self):
        """Have a docstring that is longer than what anybody wants to fetch: it says nothing at all about anything that
        happens here, and goes on saying it for as many characters as are needed, which are more than two hundred, and
        fewer than a thousand.
        """
        return "a short text"


def alone():
    return "nobody's method"


def needs(code, owner=None):
    return list(called(Call(code, globals(), owner)))


def test_a_call_needs_its_function_and_the_class_that_has_it():
    assert {Derived, Derived.own} <= set(filter(callable, needs(Derived.own.__code__, Derived())))
    assert {Base, Base.inherited} <= set(filter(callable, needs(Base.inherited.__code__, Derived())))
    assert alone in needs(alone.__code__)


def test_a_property_is_a_function_too():
    found = vars(Base)["computed"]
    assert {id(found), id(found.fget), id(Base)} <= {id(thing) for thing in needs(found.fget.__code__, Derived())}


def test_what_cannot_be_found_is_left_out():
    inside = next(
        thing for thing in test_what_cannot_be_found_is_left_out.__code__.co_consts if hasattr(thing, "co_code")
    )
    assert inside in needs(inside)

    def never_called():
        """Be a code that no module has under its name."""


def test_constants_and_names_are_needed_and_docstrings_are_not():
    code = Derived.own.__code__
    texts = [thing for thing in needs(code, Derived()) if isinstance(thing, str)]
    assert "a short text" in texts
    assert all(len(text) < MAX_BYTES for text in texts)
    assert {id(name) for name in alone.__code__.co_names} <= {id(thing) for thing in needs(alone.__code__)}


class Slotted:
    """Has its attributes in itself."""

    __slots__ = ("function", "kind", "module", "number")

    def __init__(self):
        self.number, self.kind, self.module, self.function = [1.5], Derived, sys, alone


def test_an_object_holds_the_values_of_its_attributes_but_no_classes_modules_and_functions():
    slotted = Slotted()
    assert list(held(slotted)) == [slotted, slotted.number]


def test_an_object_with_a_dictionary_holds_them_as_well():
    derived = Derived()
    derived.number = [1.5]
    found = [id(thing) for thing in held(derived)]
    assert found[0] == id(derived)
    assert {id(derived.number), id(vars(derived))} & set(found[1:])


@pytest.mark.parametrize("thing", [alone.__code__, Derived, (1, 2, 3), 0.5, "text", vars(Base)["computed"]])
def test_every_line_is_there_once(thing):
    lines = addresses([thing, thing])
    assert (np.diff(lines) == LINE_BYTES).all()
    first, size = id(thing), sys.getsizeof(thing)
    assert lines[0] <= first - HEADER_BYTES < lines[0] + LINE_BYTES
    last = first + (size if hasattr(thing, "co_code") or isinstance(thing, type) else min(size, MAX_BYTES)) - 1
    assert lines[-1] <= last < lines[-1] + LINE_BYTES


def test_of_a_large_thing_only_the_beginning_is_fetched():
    assert addresses([np.zeros(9000)]).size <= 1 + (HEADER_BYTES + MAX_BYTES) // LINE_BYTES
