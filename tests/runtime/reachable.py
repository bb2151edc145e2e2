"""All that can be reached from an object, as plain values: whether a call has written anything, wherever."""

from collections import deque

import numpy as np
from pydantic import BaseModel


def reachable(root):
    """Return the content of everything reachable; equal before and after a call that leaves no trace."""
    content: list[object] = []
    seen: dict[int, int] = {}
    waiting = [root]
    while waiting:
        one = waiting.pop()
        if isinstance(one, np.ndarray):
            content.append((one.dtype.str, one.shape, one.tobytes()))
        elif isinstance(one, dict | list | tuple | set | frozenset | deque):
            parts = list(one.items()) if isinstance(one, dict) else list(one)
            content.append((type(one), len(parts)))
            waiting += parts
        elif (
            one is None or callable(one) or isinstance(one, bool | int | float | complex | str | BaseModel | np.generic)
        ):
            content.append(repr(one))
        elif id(one) in seen:
            content.append(seen[id(one)])
        else:
            seen[id(one)] = len(seen)
            slots = [name for kind in type(one).__mro__ for name in getattr(kind, "__slots__", ())]
            fields = {name: getattr(one, name) for name in slots if hasattr(one, name)} | getattr(one, "__dict__", {})
            content.append((type(one), tuple(fields)))
            waiting += fields.values()
    return content
