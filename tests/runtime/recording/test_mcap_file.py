"""A recording costs memory by its index alone, and little; its bytes are those that the package `mcap` writes."""

import mmap
import tracemalloc
from io import BytesIO

from mcap.writer import CompressionType, Writer

from tests.runtime.observed import HandClock
from tests.runtime.recording.disks import QuickDisk
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording import black_box, channels
from wallride.runtime.recording.channels import RecordMessage, schema_text
from wallride.runtime.recording.mcap_file import CHUNK_B, METADATA, PROFILE, McapFile
from wallride.runtime.recording.ring import Ring
from wallride.runtime.recording.writer import FILL_B, FileMetadata, RecordingWriter
from wallride.runtime.settings.recording import RecordingSettings

TOPICS = [f"topic{number}" for number in range(14)]
FACTS = {"car": "test"}
MAX_KEPT_B = 400
"""Bytes kept for each chunk with messages of all topics."""


def messages(chunks):
    for chunk in range(chunks):
        for topic in TOPICS:
            yield RecordMessage(topic, channels.STRING, chunk * 10**8, bytes(3000), chunk)


def written(file, chunks):
    for number, message in enumerate(messages(chunks), start=1):
        file.add(message)
        if number % len(TOPICS) == 0:
            file.flush()


def test_a_file_is_byte_for_byte_the_one_of_the_package(tmp_path):
    path = tmp_path / "ours.mcap"
    file = McapFile(path, QuickDisk(), FACTS, "wallride")
    written(file, 30)
    file.close()
    theirs = BytesIO()
    writer = Writer(theirs, chunk_size=CHUNK_B, compression=CompressionType.NONE)
    writer.start(PROFILE, "wallride")
    writer.add_metadata(METADATA, FACTS)
    schema = None
    known = {}
    for number, message in enumerate(messages(30), start=1):
        if schema is None:
            schema = writer.register_schema(message.schema, "ros2msg", schema_text(message.schema).encode())
        if message.topic not in known:
            known[message.topic] = writer.register_channel(
                f"/{message.topic}", "cdr", schema, {"offered_qos_profiles": ""}
            )
        stamp_ns = message.stamp_ns
        writer.add_message(known[message.topic], stamp_ns, message.payload, stamp_ns, message.sequence)
        if number % len(TOPICS) == 0:
            writer.flush()
    writer.finish()
    assert path.read_bytes() == theirs.getvalue()


def test_what_is_kept_of_a_chunk_until_the_end_is_small(tmp_path):
    file = McapFile(tmp_path / "long.mcap", QuickDisk(), FACTS, "wallride")
    written(file, 20)
    tracemalloc.start()
    try:
        written(file, 500)
        kept_b = tracemalloc.get_traced_memory()[0] / 500
    finally:
        tracemalloc.stop()
    file.close()
    assert kept_b < MAX_KEPT_B


def test_the_memory_of_black_boxes_uses_its_blocks_again(monkeypatch):
    made = []
    plain = mmap.mmap

    def counted(*arguments):
        made.append(plain(*arguments))
        return made[-1]

    monkeypatch.setattr("wallride.runtime.recording.black_box.mmap.mmap", counted)
    memory = black_box.Memory(longest_s=2.0)
    payloads = [bytes([number % 256]) * (3000 + number) for number in range(500)]
    tracemalloc.start()
    try:
        for number, payload in enumerate(payloads):
            lasting = number == 10
            memory.add(RecordMessage("t", channels.STRING, number * 10**7, payload, number, lasting=lasting))
        kept_b = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    kept = list(memory.since(0))
    assert [message.sequence for message in kept] == [10, *range(299, 500)]
    assert all(message.payload == payloads[message.sequence] for message in kept)
    assert kept_b < 200 * 1000, "of 700 kB the allocator has the objects only"
    assert len(made) <= 201 * 3500 / black_box.BLOCK_B + 2
    large = bytes(2 * black_box.BLOCK_B)
    memory.add(RecordMessage("t", channels.STRING, 500 * 10**7, large, 500))
    assert [message.payload for message in memory.since(500)][-1] == large


def test_a_remembered_half_minute_is_written_piece_by_piece(tmp_path):
    """At once it would take as much memory again, and the process would keep it."""
    lengths = []

    class CountingDisk(QuickDisk):
        def write(self, descriptor, data):
            lengths.append(len(data))
            return super().write(descriptor, data)

    settings = RecordingSettings(folder=str(tmp_path), keep_free_mb=0, start="request")
    clock = HandClock(100.0)
    disk = CountingDisk()
    facts = FileMetadata("car1", "9.9", 0.0, WallClock(clock))
    writer = RecordingWriter(settings, Ring(tmp_path, settings, disk, "b"), disk, facts, breathe=lambda: None)
    now_ns = facts.wall_clock.started_unix_ns(clock.now_s)
    many = [RecordMessage("t", channels.STRING, now_ns, bytes(10_000), number) for number in range(300)]
    writer.turn(many, ["a test"], 0.0, clock.now_s)
    assert max(lengths) < FILL_B + 2 * CHUNK_B
    assert sum(lengths) > 300 * 10_000
    writer.close()
