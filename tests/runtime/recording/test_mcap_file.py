"""A recording costs memory by its index alone, and little; its bytes are those that the package `mcap` writes."""

import tracemalloc
from io import BytesIO

from mcap.writer import CompressionType, Writer

from runtime.recording import channels
from runtime.recording.channels import RecordMessage, schema_text
from runtime.recording.mcap_file import CHUNK_B, METADATA, PROFILE, McapFile
from tests.runtime.recording.disks import QuickDisk

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
