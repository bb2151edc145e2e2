"""Files that unpack to far more than a recording of their size: one sentence, before the memory is gone."""

import sqlite3
import tracemalloc
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import InvalidMagic
from mcap.writer import CompressionType, Writer

from wallride.clients import log_info
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.recording import open_recording
from wallride.runtime.recording import unpacking
from wallride.runtime.recording.recover import RecoveryError, recover
from wallride.runtime.recording.unpacking import Unpacking
from wallride.sim.recordings import RecordingError, load_recording
from wallride.sim.replay.drive_log import read_log


def mcap(path: Path, messages: int, message_b: int, compression: CompressionType) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 30, compression=compression)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/LaserScan", "ros2msg", b"")
        channel = writer.register_channel("/scan", "cdr", schema)
        for number in range(messages):
            writer.add_message(channel, number + 1, bytes(message_b), number + 1)
        writer.finish()
    return path


@pytest.fixture(params=["zstd", "lz4", "messages"])
def bomb(request: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(unpacking, "LEAST_BYTES", 2_000_000)
    monkeypatch.setattr(unpacking, "LEAST_MESSAGES", 1000)
    monkeypatch.setattr(unpacking, "BYTES_PER_MESSAGE", 1000)
    if request.param == "messages":
        return mcap(tmp_path / "bomb.mcap", 5000, 0, CompressionType.ZSTD)
    return mcap(tmp_path / "bomb.mcap", 40, 1_000_000, CompressionType[request.param.upper()])


def test_a_bomb_is_refused_by_every_reader_in_a_sentence(bomb: Path) -> None:
    tracemalloc.start()
    for read, refusal in (
        (load_recording, RecordingError), (read_log, RecordingError), (log_info.read, ConnectionProblemError),
        (lambda path: open_recording(path).topic_names, ConnectionProblemError),
    ):  # fmt: skip
        with pytest.raises(refusal, match=r"bomb\.mcap: it has 0\.. MB and .*more .*(than|no recording)"):
            read(bomb)
    content = bomb.read_bytes()
    bomb.write_bytes(content[:-8])
    with pytest.raises(RecoveryError, match=r"it has 0\.. MB and .*; it is left as it is"):
        recover(bomb)
    assert bomb.read_bytes() == content[:-8]
    _, peak_b = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_b < 20_000_000


def test_a_chunk_in_itself_and_a_footer_in_a_chunk_end() -> None:
    from mcap.records import Chunk

    footer = b"\x02" + (20).to_bytes(8, "little") + bytes(20)
    unknown = b"\x7f" + (4).to_bytes(8, "little") + bytes(4)
    for data in (unknown * 3, footer + unknown, b""):
        chunk = Chunk("", data, 0, 0, 0, len(data))
        with suppress(InvalidMagic):  # behind the footer
            list(Unpacking(100).inside(chunk))


def test_a_bomb_of_arrays_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, ranges=np.zeros((70_000, 1081), dtype=np.float32))
    with pytest.raises(
        RecordingError, match=r"it has 0\.. MB and unpacks to more than 268 MB, which no recording does"
    ):
        load_recording(path)


def test_a_reader_that_takes_all_memory_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.bag"
    path.write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.setattr("wallride.sim.recordings.ros._collect", lambda *_: bytearray(8 << 30))
    with pytest.raises(RecordingError, match=r"r\.bag: it has 0\.0 MB and unpacks to more than"):
        load_recording(path)
    bytearray(1 << 30)  # the bound holds while a file is read


@pytest.mark.parametrize("name", ["messages", "topics", "MESSAGES"])
def test_a_view_in_place_of_a_table_is_refused(ros2: Any, ros2_story: Any, tmp_path: Path, name: str) -> None:
    (path,) = ros2.write(tmp_path / "r", ros2_story).glob("*.db3")
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"ALTER TABLE {name} RENAME TO real")
        database.execute(
            f"CREATE VIEW {name} AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)"  # noqa: S608 - ours
            " SELECT n.id, 1 AS topic_id, 1 AS timestamp, x'00' AS data, '/scan' AS name, 'x' AS type FROM n"
        )
    for which in (path, path.parent):
        with pytest.raises(RecordingError, match=rf"\.db3: {name} is a view, not a table"):
            load_recording(which)
