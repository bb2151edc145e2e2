"""The reply frame that RPLIDAR and YDLIDAR share."""

from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.golden import pieces
from wallride.drivers.turning.conversation import describe
from wallride.drivers.turning.replies import MAX_PAYLOAD_BYTES, Reply, ReplyDeframer

HEALTH = bytes.fromhex("a55a0300000006010200")
STREAM = bytes.fromhex("a55a5400004082")
GREETING = b"RP LIDAR System.\r\nFirmware Ver 1.29\r\n"


def read(stream: bytes, *edges: int) -> tuple[list[Reply], bytes]:
    deframer = ReplyDeframer()
    return [reply for piece in pieces(stream, *edges) for reply in deframer.feed(piece)], deframer.rest


@given(st.lists(st.integers(1, 60), max_size=8))
def test_replies_are_found_whatever_the_chunks(edges):
    found, _ = read(GREETING + HEALTH + b"\xa5" + HEALTH, *edges)
    assert found == [Reply(6, b"\x01\x02\x00", 3)] * 2


def test_what_follows_the_announcement_of_a_stream_is_kept():
    found, rest = read(HEALTH + STREAM + b"\xa5\x5aabc")
    assert found[-1] == Reply(0x82, b"", 84, streams=True)
    assert rest == b"\xa5\x5aabc"


def test_an_impossible_length_is_noise():
    found, _ = read(b"\xa5\x5a" + (MAX_PAYLOAD_BYTES + 1).to_bytes(4, "little") + b"\x04" + HEALTH)
    assert [reply.kind for reply in found] == [6]


@given(st.binary(max_size=3000))
def test_noise_is_bounded_and_raises_nothing(noise):
    deframer = ReplyDeframer()
    for at in range(0, len(noise), 100):
        deframer.feed(noise[at : at + 100])
    assert len(deframer.rest) <= max(MAX_PAYLOAD_BYTES + 7, 100)


def test_what_is_on_the_port_is_named():
    assert "nothing came" in describe(b"")
    assert "zero bytes" in describe(bytes(50))
    assert "YDLIDAR" in describe(b"\xaa\x55\x00\x08abcdefgh\xaa\x55\x00\x08")
    assert "RPLIDAR" in describe(GREETING)
    assert "Hokuyo" in describe(b"MD0000108000000\n00P\n\n")
    assert "stray" in describe(b"\x01\x80\x05")
    assert "other bytes" in describe(bytes(range(1, 200)))
