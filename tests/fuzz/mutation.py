"""Damaged copies of good inputs, from a seed: bits, borders, lengths, repeated and swapped pieces."""

import random
from collections.abc import Sequence

BORDERS = (b"\x00", b"\x01", b"\x7f", b"\x80", b"\xff", b"\x00" * 4, b"\xff" * 4, b"\x7f\xff\xff\xff", b"\xff" * 8,
           b"\x00\x00\xf8\x7f", b"[" * 64, b'"', b"\\", b"\n", b"\n\n", b";", b"9" * 32, b"\x1b[2J")  # fmt: skip
MAX_GROWTH = 4


def mutated(dice: random.Random, good: bytes, others: Sequence[bytes], most_bytes: int) -> bytes:
    """Return a damaged copy, at most most_bytes long; one in 16 is pure noise."""
    if dice.random() < 1 / 16:
        return dice.randbytes(dice.randrange(min(256, most_bytes)))
    data = bytearray(good)
    for _ in range(dice.choice((1, 1, 1, 2, 3, 8))):
        _damage(dice, data, others)
        if len(data) > MAX_GROWTH * len(good) + 256:
            break
    return bytes(data[:most_bytes])


def _damage(dice: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    at = dice.randrange(len(data) + 1)
    end = min(len(data), at + dice.choice((1, 2, 4, 16, 64, 256)))
    match dice.randrange(8):
        case 0 if at < len(data):
            data[at] ^= 1 << dice.randrange(8)
        case 1 if at < len(data):
            data[at] = dice.randrange(256)
        case 2:
            piece = dice.choice(BORDERS)
            data[at : at + len(piece)] = piece
        case 3:
            data[at:at] = dice.choice(BORDERS)
        case 4:
            del data[at:end]
        case 5:
            data[at:at] = data[at:end] * dice.choice((1, 2, 8))
        case 6:
            del data[at:]
        case 7:
            other = dice.choice(others)
            begin = dice.randrange(len(other) + 1)
            data[at:end] = other[begin : begin + dice.choice((4, 16, 64))]
