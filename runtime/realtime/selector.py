"""A `select()` selector that refuses what it cannot watch.

With epoll, Python's timers come in whole milliseconds and up to one late; select() is accurate to 0.1 ms, and as quick
for the few descriptors of a car.
"""

import selectors
from typing import TYPE_CHECKING, Any

from wallride.drivers.spare_descriptors import check

if TYPE_CHECKING:
    from _typeshed import FileDescriptorLike


class CheckedSelector(selectors.SelectSelector):
    """The standard library's selector, with the check that `select()` makes only at the next turn of the loop."""

    def register(self, fileobj: "FileDescriptorLike", events: int, data: Any = None) -> selectors.SelectorKey:  # noqa: ANN401 - as its base has it
        """Register a descriptor; OSError EMFILE where `select()` cannot watch it.

        The ValueError of `select()` would end the loop at the next turn.
        """
        check(fileobj if isinstance(fileobj, int) else fileobj.fileno())
        return super().register(fileobj, events, data)
