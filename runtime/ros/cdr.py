"""CDR, the encoding of ROS 2 messages: little endian, every number aligned to its own size (OMG XCDR1).

Four bytes name the encapsulation (00 01 00 00: CDR, little endian); alignment counts from the byte after them.
"""

from collections.abc import Mapping
from functools import lru_cache
from struct import Struct, calcsize
from typing import Any

import numpy as np
import numpy.typing as npt

ENCAPSULATION = b"\x00\x01\x00\x00"
_NUMBERS: Mapping[str, np.dtype[Any]] = {"f": np.dtype("<f4"), "d": np.dtype("<f8"), "B": np.dtype("u1")}


class CdrWriter:
    """Collects the fields of one message in the order of its definition."""

    __slots__ = ("_buffer",)

    def __init__(self) -> None:
        self._buffer = bytearray(ENCAPSULATION)

    def put(self, letters: str, *values: float) -> None:
        """Add numbers; letters as in `struct`, one for each: "iI" is an int32 and a uint32."""
        buffer = self._buffer
        buffer += _layout(letters, (len(buffer) - len(ENCAPSULATION)) % 8).pack(*values)

    def text(self, text: str) -> None:
        """Add a string."""
        data = text.encode()
        self.put("I", len(data) + 1)
        self._buffer += data + b"\0"

    def texts(self, texts: tuple[str, ...]) -> None:
        """Add a sequence of strings."""
        self.put("I", len(texts))
        for text in texts:
            self.text(text)

    def array(self, letter: str, values: npt.NDArray[Any]) -> None:
        """Add an array whose length the definition fixes; letter f, d or B."""
        numbers = np.ascontiguousarray(values, _NUMBERS[letter])
        self.align(numbers.itemsize)
        self._buffer += numbers.data if numbers.size else b""

    def sequence(self, letter: str, values: npt.NDArray[Any]) -> None:
        """Add a sequence of numbers of any length; letter f, d or B."""
        self.put("I", values.size)
        if values.size:
            self.array(letter, values)

    def align(self, size_bytes: int) -> None:
        """Pad to a multiple of this."""
        self._buffer += bytes(-(len(self._buffer) - len(ENCAPSULATION)) % size_bytes)

    def done(self) -> bytes:
        """Return the message."""
        return bytes(self._buffer)


class Template(CdrWriter):
    """A message of which only some numbers change: written once, then copied with the numbers filled in.

    Half the time of writing it anew, forty times a second.
    """

    __slots__ = ("_holes", "_numbers")

    def __init__(self) -> None:
        super().__init__()
        self._holes: list[tuple[Struct, int, slice]] = []
        self._numbers = 0

    def holes(self, letters: str) -> None:
        """Leave room for numbers; letters as in `put`."""
        layout = _layout(letters, (len(self._buffer) - len(ENCAPSULATION)) % 8)
        numbers = slice(self._numbers, self._numbers + len(letters))
        self._holes.append((layout, len(self._buffer), numbers))
        self._buffer += bytes(layout.size)
        self._numbers = numbers.stop

    def fill(self, *values: float) -> bytes:
        """Return the message with all its holes filled, in their order."""
        filled = bytearray(self._buffer)
        for layout, at, numbers in self._holes:
            layout.pack_into(filled, at, *values[numbers])
        return bytes(filled)


@lru_cache(maxsize=256)
def _layout(letters: str, phase: int) -> Struct:
    """Return the packer of some numbers that begin `phase` bytes after a multiple of 8."""
    code, at = "<", phase
    for letter in letters:
        size = calcsize(f"<{letter}")
        gap = -at % size
        code += "x" * gap + letter
        at += gap + size
    return Struct(code)
