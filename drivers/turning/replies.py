"""Requests and replies that RPLIDAR and YDLIDAR share: the reply frame. Pure.

    reply    A5 5A, length (30 bits) and mode (2 bits) little-endian, type, payload

Mode 1 announces a stream: its bytes follow without any further frame. Source: Slamtec protocol v2.8; YDLIDAR SDK.
"""

from typing import Final

from wallride.drivers.value import value

HEAD: Final = b"\xa5\x5a"
HEAD_BYTES: Final = 7
MAX_PAYLOAD_BYTES: Final = 1024
"""Maximum length of a reply: the longest is one packet of a stream, 781 bytes. More is noise that looks like a head."""


_INFO_BYTES, _HEALTH_BYTES = 20, 3


@value()
class Reply:
    """One reply. streams: a stream of packets of `length` bytes follows; payload is empty then."""

    kind: int
    payload: bytes
    length: int
    streams: bool = False


class ReplyDeframer:
    """Finds replies in a byte stream, whatever the chunking; everything else is skipped. Never raises.

    rest: bytes after the announcement of a stream.
    """

    def __init__(self) -> None:
        self.rest = b""

    def reset(self) -> None:
        """Drop an incomplete reply."""
        self.rest = b""

    def feed(self, chunk: bytes) -> list[Reply]:
        """Add bytes and return the replies that they completed; the one that announces a stream is the last."""
        data, found, at = self.rest + chunk, [], 0
        while (at := data.find(HEAD, at)) >= 0 and len(data) - at >= HEAD_BYTES:
            word = int.from_bytes(data[at + 2 : at + 6], "little")
            length, streams, kind = word & 0x3FFF_FFFF, word >> 30 == 1, data[at + 6]
            if length > MAX_PAYLOAD_BYTES:
                at += len(HEAD)
                continue
            if streams:
                found.append(Reply(kind, b"", length, streams=True))
                self.rest = data[at + HEAD_BYTES :]
                return found
            end = at + HEAD_BYTES + length
            if len(data) < end:
                break
            found.append(Reply(kind, data[at + HEAD_BYTES : end], length))
            at = end
        self.rest = data[at:] if at >= 0 else data[-1:] if data.endswith(HEAD[:1]) else b""
        return found


@value()
class SensorInfo:
    """Identity of a sensor. model: the maker's number. firmware: (major, minor). serial: as sent, 16 bytes."""

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial: bytes


@value()
class SensorCondition:
    """What a sensor says of itself: 0 good, 1 warning, 2 fault; code of the error."""

    status: int
    code: int


def decode_info(payload: bytes) -> SensorInfo | None:
    """Return the identity, None for a reply of another length."""
    if len(payload) != _INFO_BYTES:
        return None
    return SensorInfo(payload[0], (payload[2], payload[1]), payload[3], payload[4:])


def decode_condition(payload: bytes) -> SensorCondition | None:
    """Return the condition, None for a reply of another length."""
    if len(payload) != _HEALTH_BYTES:
        return None
    return SensorCondition(payload[0], int.from_bytes(payload[1:], "little"))
