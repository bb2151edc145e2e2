"""Frames and requests of the VESC's serial protocol as bytes, without a port, a clock or a log.

Frame, all numbers big-endian (vedderb/bldc `comm/packet.c`):

    02 | length 1 B | payload | CRC-16/XMODEM of the payload 2 B | 03      payload of 1 .. 255 B
    03 | length 2 B | payload | CRC-16/XMODEM of the payload 2 B | 03      payload of 256 .. 512 B

There is no byte stuffing: 02 and 03 occur freely inside payloads. The first byte of a payload is a `Packet` id.
Motor and servo requests are never acknowledged (`comm/commands.c`).
"""

import struct
from binascii import crc_hqx
from enum import IntEnum

MAX_PAYLOAD_BYTES = 512
_SHORT_MAX_BYTES = 255
_SHORT_START, _LONG_START, _STOP = 2, 3, 3
_TAIL_BYTES = 3
_HEADER_BYTES = {
    _SHORT_START: 2,
    _LONG_START: 3,
}  # start byte 4, three length bytes, is above the limit of any firmware
_MIN_LENGTH_BYTES = {
    _SHORT_START: 1,
    _LONG_START: _SHORT_MAX_BYTES,
}  # the firmware refuses a long form that is too short

_INT16 = struct.Struct(">Bh")
_INT32 = struct.Struct(">Bi")
_UINT16 = struct.Struct(">BH")


class Packet(IntEnum):
    """The first byte of a payload (`datatypes.h`, COMM_PACKET_ID), as far as relevant to a car."""

    FW_VERSION = 0
    GET_VALUES = 4
    SET_DUTY = 5
    SET_CURRENT = 6
    SET_CURRENT_BRAKE = 7
    SET_RPM = 8
    SET_POS = 9
    SET_HANDBRAKE = 10
    SET_SERVO_POS = 12
    SET_APPCONF = 16
    GET_APPCONF = 17
    PRINT = 21
    ALIVE = 30
    GET_VALUES_SELECTIVE = 50
    GET_IMU_DATA = 65
    SET_CURRENT_REL = 84


MOTOR_PACKETS = frozenset(
    {
        Packet.SET_DUTY,
        Packet.SET_CURRENT,
        Packet.SET_CURRENT_BRAKE,
        Packet.SET_RPM,
        Packet.SET_POS,
        Packet.SET_HANDBRAKE,
        Packet.SET_CURRENT_REL,
    }
)
"""Requests that move, release or hold the motor. They and ALIVE feed the VESC's command timeout, no others do."""


class VescDeframer:
    """Finds frames in a byte stream, whatever the chunking.

    Bytes that belong to no frame are skipped one at a time, which is the firmware's own rule: a false start must not
    swallow the true frame behind it. They are counted, never raised.

    skipped_bytes: bytes that belonged to no frame.
    bad_checksums: candidates that were complete up to the stop byte but failed the CRC.
    """

    def __init__(self) -> None:
        self.skipped_bytes = 0
        self.bad_checksums = 0
        self._buffer = bytearray()

    def feed(self, chunk: bytes) -> list[bytes]:
        """Add bytes and return the payloads they completed, oldest first."""
        self._buffer += chunk
        return self._take_frames(wait=True)

    def give_up(self) -> list[bytes]:
        """Stop waiting for the rest of an incomplete frame; return the payloads hidden behind its start."""
        return self._take_frames(wait=False)

    def _take_frames(self, *, wait: bool) -> list[bytes]:
        buffer, at, payloads = self._buffer, 0, []
        while at < len(buffer):
            end = _frame_end(buffer, at)
            if end > len(buffer) and wait:
                break
            payload = self._payload(at, end) if at < end <= len(buffer) else None
            if payload is None:
                at += 1
                self.skipped_bytes += 1
            else:
                payloads.append(payload)
                at = end
        del buffer[:at]
        return payloads

    def _payload(self, at: int, end: int) -> bytes | None:
        buffer = self._buffer
        if buffer[end - 1] != _STOP:
            return None
        payload = bytes(buffer[at + _HEADER_BYTES[buffer[at]] : end - _TAIL_BYTES])
        if crc_hqx(payload, 0) != buffer[end - 3] << 8 | buffer[end - 2]:
            self.bad_checksums += 1
            return None
        return payload


def _frame_end(buffer: bytearray, at: int) -> int:
    """Return the end of the frame that starts here (perhaps beyond the buffer), or `at` if none can start here."""
    header_bytes = _HEADER_BYTES.get(buffer[at])
    if header_bytes is None:
        return at
    if len(buffer) < at + header_bytes:
        return at + header_bytes + _TAIL_BYTES
    size_bytes = int.from_bytes(buffer[at + 1 : at + header_bytes], "big")
    if not _MIN_LENGTH_BYTES[buffer[at]] <= size_bytes <= MAX_PAYLOAD_BYTES:
        return at
    return at + header_bytes + size_bytes + _TAIL_BYTES


def frame(payload: bytes) -> bytes:
    """Wrap a payload of 1 to 512 bytes; ValueError when the VESC would refuse its size."""
    size = len(payload)
    if not 1 <= size <= MAX_PAYLOAD_BYTES:
        raise ValueError(f"a VESC payload has 1 to {MAX_PAYLOAD_BYTES} bytes, this one has {size}")
    header = bytes((_SHORT_START, size)) if size <= _SHORT_MAX_BYTES else bytes((_LONG_START, size >> 8, size & 0xFF))
    return b"%b%b%b\x03" % (header, payload, crc_hqx(payload, 0).to_bytes(2, "big"))


# Payloads of requests. Numbers are rounded, not truncated (0.57 x 1000 is 569.999... in binary); NaN, infinity and
# values outside the range of the wire are a ValueError.


def plain(packet: Packet) -> bytes:
    """Request without arguments: FW_VERSION, GET_VALUES, GET_APPCONF, ALIVE."""
    return bytes((packet,))


def set_brake_current(current_a: float) -> bytes:
    """Brake until standstill, without holding; under 0.05 A the firmware does not brake at all."""
    return _scaled(_INT32, Packet.SET_CURRENT_BRAKE, current_a, 1000)


def set_erpm(erpm: float) -> bytes:
    """Hold an electrical speed, positive forward. Under s_pid_min_erpm (900) the firmware coasts: 0 is no brake."""
    return _scaled(_INT32, Packet.SET_RPM, erpm, 1)


def set_servo(position: float) -> bytes:
    """Move the servo to 0..1, a pulse of 1000 to 2000 us in steps of 1 us. Does not feed the command timeout."""
    return _scaled(_INT16, Packet.SET_SERVO_POS, position, 1000)


def get_imu(mask: int = 0xFFFF) -> bytes:
    """Request inertial data: 9 bits for roll..gyro z, 3 magnetometer, 4 quaternion."""
    return _UINT16.pack(Packet.GET_IMU_DATA, mask)


def _scaled(layout: struct.Struct, packet: Packet, value: float, scale: int) -> bytes:
    try:
        return layout.pack(packet, round(value * scale))
    except (ValueError, OverflowError, struct.error):  # NaN, infinity, more than the wire can carry
        raise ValueError(f"{packet.name} cannot carry {value!r}") from None
