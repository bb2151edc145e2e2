"""RPLIDAR's compressed streams: capsules in a byte stream, and the angles of their samples. Pure.

    capsule   A and low half of the sum, 5 and high half of the sum, ..., start angle (15 bits, 1/64 degree), samples

The sum is the exclusive or of all bytes from the third on. A capsule tells only where its first sample was taken: its
samples lie between its start and that of the next one, so that each is decoded when the next one has come. Where one
was lost, the two beside it are not next to each other and give nothing.
"""

import zlib
from collections.abc import Callable
from typing import Final

import numpy as np

from wallride.drivers.rplidar import capsule_formats
from wallride.drivers.rplidar.capsule_formats import Floats
from wallride.drivers.turning.samples import NO_SAMPLES, Count, HeadSamples, SampleDecoder, joined, lost_samples, metres
from wallride.drivers.value import value

EXPRESS, HQ, ULTRA, DENSE, ULTRA_DENSE = 0x82, 0x83, 0x84, 0x85, 0x86
FIRST_AFTER_START: Final = 0x8000
_STRETCH: Final = 1.5
"""Maximum angle between two starts, in multiples of the usual one: a lost capsule doubles it."""
_PATIENCE: Final = 8
"""Number of capsules in a row with another angle that make it the usual one: the motor has changed its speed."""
_MAX_TURN_DEG: Final = 180.0


@value()
class Format:
    """Layout of one kind of capsule: length, samples, place of the start angle, and the function for its samples.

    decode: takes the samples' bytes, those of the next capsule, and the last distance [mm] before.
    """

    length: int
    samples: int
    start_at: int
    decode: Callable[[bytes, bytes, int], tuple[Floats, Floats]]


FORMATS: Final = {
    EXPRESS: Format(84, 32, 2, lambda body, _next, _mm: capsule_formats.express(body)),
    ULTRA: Format(132, 96, 2, lambda body, following, _mm: capsule_formats.ultra(body, following)),
    DENSE: Format(84, 40, 2, lambda body, _next, _mm: capsule_formats.dense(body)),
    ULTRA_DENSE: Format(170, 64, 8, lambda body, _next, mm: capsule_formats.ultra_dense(body, mm)),
}
"""The formats by the type of their stream."""


class CapsuleDecoder:
    """Decodes a stream of capsules of one format, whatever the chunking.

    Counts "checksum" (a damaged capsule), "resync" (bytes between capsules) and "stretched" (a lost capsule).
    """

    def __init__(self, kind: int, count: Count) -> None:
        self._format = FORMATS[kind]
        self._count = count
        self._rest = b""
        self._cached = b""
        self._usual_deg = 0.0
        self._unusual = 0
        self._last_mm = 0

    @property
    def behind(self) -> int:
        """Number of samples that wait for later bytes."""
        return self._format.samples

    def feed(self, chunk: bytes) -> HeadSamples:
        """Add bytes and return the samples that they completed."""
        data, length, at, skipped, lost = self._rest + chunk, self._format.length, 0, 0, 0
        parts: list[HeadSamples] = []
        while len(data) - at >= length:
            capsule = data[at : at + length]
            if capsule[0] >> 4 == 0xA and capsule[1] >> 4 == 0x5:
                if _sum(capsule[2:]) == capsule[0] & 15 | (capsule[1] & 15) << 4:
                    parts.append(self._take(capsule))
                    at += length
                    continue
                self._count("checksum")
                lost += self._format.samples if self._cached else 0
                self._cached = b""
            begin, at = at, _next_sync(data, at + 1)
            skipped += at - begin
        self._rest = data[at:]
        if not skipped:
            return joined(parts)
        self._count("resync")
        lost += round(skipped * self._format.samples / length)
        return joined([*parts, lost_samples(lost)])

    def _take(self, capsule: bytes) -> HeadSamples:
        word = self._start(capsule)
        before, self._cached = self._cached, capsule
        if not before or word & FIRST_AFTER_START:
            return NO_SAMPLES
        layout = self._format
        start_deg = (self._start(before) & 0x7FFF) / 64.0
        turned_deg = ((word & 0x7FFF) / 64.0 - start_deg) % 360.0
        if not self._is_usual(turned_deg):
            self._count("stretched")
            return lost_samples(2 * layout.samples)
        body = slice(layout.start_at + 2, None)
        mm, offset_deg = layout.decode(before[body], capsule[body], self._last_mm)
        self._last_mm = int(mm[-1])
        head_deg = (start_deg + turned_deg * np.arange(layout.samples) / layout.samples) % 360.0
        return HeadSamples(head_deg, (head_deg - offset_deg) % 360.0, metres(mm))

    def _start(self, capsule: bytes) -> int:
        return int.from_bytes(capsule[self._format.start_at : self._format.start_at + 2], "little")

    def _is_usual(self, turned_deg: float) -> bool:
        """Return whether no capsule was lost between two, and follow the speed of the motor."""
        if turned_deg > _MAX_TURN_DEG:  # it went back a little: a head that stands and trembles
            return False
        usual = not self._usual_deg or turned_deg <= _STRETCH * self._usual_deg
        if usual or self._unusual >= _PATIENCE:
            self._usual_deg = turned_deg if self._unusual or not self._usual_deg else self._followed(turned_deg)
            self._unusual = 0
            return usual
        self._unusual += 1
        return False

    def _followed(self, turned_deg: float) -> float:
        return self._usual_deg + 0.1 * (turned_deg - self._usual_deg)


class HqDecoder:
    """Decodes the stream of the A3's and S series' own format: 96 samples with their own angles, and a CRC-32."""

    LENGTH: Final = 781
    SAMPLES: Final = 96
    behind = 0
    _SYNC: Final = 0xA5
    _NODE: Final = np.dtype([("angle", "<u2"), ("distance", "<u4"), ("quality", "u1"), ("flag", "u1")])

    def __init__(self, count: Count) -> None:
        self._count = count
        self._rest = b""

    def feed(self, chunk: bytes) -> HeadSamples:
        """Add bytes and return the samples that they completed."""
        data, at, skipped = self._rest + chunk, 0, 0
        parts: list[HeadSamples] = []
        while len(data) - at >= self.LENGTH:
            packet = data[at : at + self.LENGTH]
            if packet[0] == self._SYNC:
                # Its CRC covers a length that is a multiple of four: three zeros follow.
                if zlib.crc32(packet[:-4] + bytes(3)) == int.from_bytes(packet[-4:], "little"):
                    parts.append(self._samples(packet))
                    at += self.LENGTH
                    continue
                self._count("checksum")
            found, begin = data.find(self._SYNC, at + 1), at
            at = found if found >= 0 else len(data)
            skipped += at - begin
        self._rest = data[at:]
        return joined([*parts, lost_samples(round(skipped * self.SAMPLES / self.LENGTH))]) if skipped else joined(parts)

    def _samples(self, packet: bytes) -> HeadSamples:
        nodes = np.frombuffer(packet[9:-4], self._NODE)
        deg = nodes["angle"] * (90.0 / 16384.0) % 360.0
        return HeadSamples(deg, deg, metres(nodes["distance"] / 4.0))


def decoder_for(kind: int, count: Count) -> SampleDecoder | None:
    """Return the decoder of a type of stream other than the plain one, None where there is none."""
    if kind == HQ:
        return HqDecoder(count)
    return CapsuleDecoder(kind, count) if kind in FORMATS else None


def _sum(body: bytes) -> int:
    return int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))


def _next_sync(data: bytes, at: int) -> int:
    """Return the place of the next byte that can begin a capsule, the end where there is none."""
    return next((place for place in range(at, len(data)) if data[place] >> 4 == 0xA), len(data))
