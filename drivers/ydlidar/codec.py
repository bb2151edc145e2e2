"""YDLIDAR on the wire: commands out, identity and scan packets in. No port, no clock, no log.

    command   A5 code
    packet    AA 55, CT (start of a turn, frequency), number of samples, first and last angle, sum, samples

The sum is the exclusive or of the packet's 16-bit words, the whole CT byte included. Numbers are little-endian. Source:
the protocol document of the YDLIDAR SDK, and the SDK where that is wrong.
"""

from typing import Final

import numpy as np

from wallride.drivers.turning.samples import Count, Floats, HeadSamples, joined, lost_samples, metres
from wallride.drivers.value import value
from wallride.drivers.ydlidar.models import Model

SCAN, STOP, GET_INFO, GET_HEALTH, GET_HEALTH_OLD, RESET, RESET_OLD = 0x60, 0x65, 0x90, 0x92, 0x91, 0x80, 0x40
"""Codes of the commands in use; the manuals and the SDK disagree on two of them."""
INFO, HEALTH, STREAM = 0x04, 0x06, 0x81
"""Types of the replies."""
HEAD: Final = b"\xaa\x55"
_TIME_HEAD, _TIME_BYTES = b"\xaa\x66", 8
_HEAD_BYTES: Final = 10
MAX_SAMPLES: Final = 80
"""Maximum number of samples in a packet; more is noise that looks like a head."""
MAX_SPAN_DEG: Final = 180.0
"""Maximum angle of a packet; more is a head that stands and trembles, whose last angle is a little before the first."""
_MEAN_SAMPLE_BYTES: Final = 2.25
"""Bytes for each sample in a full packet, its head included."""


def command(code: int) -> bytes:
    """Return the bytes of a command."""
    return bytes([0xA5, code])


@value()
class ScanPacket:
    """One scan packet whose sum is right. starts: a turn starts. turns_hz: of the head, 0 where it is not told."""

    starts: bool
    turns_hz: float
    samples: HeadSamples


class PacketDecoder:
    """Decodes the stream of one model, whatever the chunking.

    turns_hz: speed of the head as the sensor told last, 0 before. packets: number of valid packets.
    Counts "checksum" (a damaged packet) and "resync" (bytes between packets).
    """

    behind = 0
    """Number of samples that wait for later bytes."""

    def __init__(self, model: Model, count: Count) -> None:
        self._model = model
        self._count = count
        self._rest = b""
        self._skipped = 0
        self.turns_hz = 0.0
        self.packets = 0

    def feed(self, chunk: bytes) -> HeadSamples:
        """Add bytes and return the samples that they completed; the one of a start packet is none."""
        parts, self._skipped = [], 0
        for packet in self.packets_in(chunk):
            if packet.starts:
                self.turns_hz = packet.turns_hz or self.turns_hz
            else:
                parts.append(packet.samples)
        if self._skipped:
            parts.append(lost_samples(round(self._skipped / _MEAN_SAMPLE_BYTES)))
        return joined(parts)

    def packets_in(self, chunk: bytes) -> list[ScanPacket]:
        """Add bytes and return the packets that they completed, oldest first."""
        data, at, found, skipped = self._rest + chunk, 0, list[ScanPacket](), 0
        sample_bytes = 3 if self._model.intensity else 2
        while len(data) - at >= _TIME_BYTES:
            if data.startswith(_TIME_HEAD, at):
                at += _TIME_BYTES
                continue
            if data.startswith(HEAD, at):
                if len(data) - at < _HEAD_BYTES:
                    break
                length = _HEAD_BYTES + data[at + 3] * sample_bytes
                if 0 < data[at + 3] <= MAX_SAMPLES and data[at + 4] & data[at + 6] & 1:
                    if len(data) - at < length:
                        break
                    if (packet := self._packet(data[at : at + length])) is not None:
                        found.append(packet)
                        at += length
                        continue
                self._count("checksum")
            following = data.find(HEAD[:1], at + 1)
            begin, at = at, following if following >= 0 else len(data)
            skipped += at - begin
        self._rest = data[at:]
        if skipped:
            self._count("resync")
        self._skipped += skipped
        self.packets += len(found)
        return found

    def _packet(self, raw: bytes) -> ScanPacket | None:
        """Decode a whole packet, None where its sum is wrong."""
        if self._model.intensity:
            rows = np.frombuffer(raw[_HEAD_BYTES:], np.dtype([("intensity", "u1"), ("sample", "<u2")]))
            words, extra = rows["sample"], int(np.bitwise_xor.reduce(rows["intensity"]))
        else:
            words, extra = np.frombuffer(raw[_HEAD_BYTES:], "<u2"), 0
        head = np.frombuffer(raw[:_HEAD_BYTES], "<u2").astype(np.int64)
        if int(np.bitwise_xor.reduce(head) ^ np.bitwise_xor.reduce(words)) ^ extra:  # its own sum makes it zero
            return None
        first_deg, last_deg = (head[2] >> 1) / 64.0, (head[3] >> 1) / 64.0
        if (span_deg := (last_deg - first_deg) % 360.0) > MAX_SPAN_DEG:
            return ScanPacket(bool(raw[2] & 1), (raw[2] >> 1) / 10.0, lost_samples(words.size))
        step_deg = span_deg / max(1, words.size - 1)
        head_deg = (first_deg + step_deg * np.arange(words.size)) % 360.0
        mm = words / float(self._model.divisor)
        deg = (head_deg + triangulation_deg(mm)) % 360.0 if self._model.triangulates else head_deg
        return ScanPacket(bool(raw[2] & 1), (raw[2] >> 1) / 10.0, HeadSamples(head_deg, deg, metres(mm)))


def triangulation_deg(mm: Floats) -> Floats:
    """Return the direction of a measurement less that of the head, degrees, shape (n,); 0 without a distance.

    The laser is 21.8 mm beside the receiver, and both meet 155.3 mm ahead.
    """
    near_mm = np.where(mm > 0, mm, 155.3)
    return np.degrees(np.arctan(21.8 * (155.3 - near_mm) / (155.3 * near_mm)))
