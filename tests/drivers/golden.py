"""The golden bytes of the shared reference, where they are, and what the tests of codecs do with bytes."""

import json
from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

Frame = dict[str, Any]
VECTORS = Path(__file__).resolve().parents[2] / ".." / "shared" / "reference" / "vectors"
needs_vectors = pytest.mark.skipif(not VECTORS.exists(), reason=f"the golden frames ({VECTORS}) are not here")


def golden(name: str, **counts: int) -> dict[str, list[Frame]]:
    """Return the parts of a file, or empty ones where it is not. counts: how many entries a part has, or more."""
    parts: dict[str, list[Frame]] = defaultdict(list)
    if (file := VECTORS / f"{name}.json").exists():
        parts |= json.loads(file.read_text())
        assert all(len(parts[part]) >= count for part, count in counts.items()), "some of the golden bytes are gone"
    return parts


def pieces(stream: bytes, *edges: int) -> Iterator[bytes]:
    """Cut a stream at those of the edges that lie in it."""
    for a, b in pairwise(sorted({0, len(stream), *(edge for edge in edges if 0 < edge < len(stream))})):
        yield stream[a:b]


class Counts(Counter[str]):
    """What a decoder counted; `count` is what it calls."""

    def count(self, what: str) -> None:
        self[what] += 1
