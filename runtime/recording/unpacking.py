"""Records of an MCAP file with a bound on what its chunks unpack to: 200 kB of a foreign file can hold gigabytes."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from typing import Any, Final

LEAST_BYTES: Final = 256 << 20
MOST_TIMES: Final = 50
"""A file may unpack to LEAST_BYTES, or to so many times its size; a lidar's noise does not get smaller than a fifth."""
LEAST_MESSAGES: Final = 500_000
BYTES_PER_MESSAGE: Final = 8
"""Of the file: the shortest message takes 31 bytes before it is packed."""
MAX_RECORD_B: Final = 1 << 28


class UnpackingError(ValueError):
    """A file that unpacks to more than its size explains; the text says how much."""


def most_bytes(size_bytes: int) -> int:
    """Return what a recording of a size may unpack to."""
    return max(LEAST_BYTES, MOST_TIMES * size_bytes)


def bomb(size_bytes: int) -> UnpackingError:
    """Return the error of a file that unpacks to more."""
    return UnpackingError(
        f"it has {size_bytes / 1e6:.1f} MB and unpacks to more than {most_bytes(size_bytes) / 1e6:.0f} MB, which no"
        " recording does"
    )


class Unpacking:
    """What a file of a size may still unpack to."""

    def __init__(self, size_bytes: int) -> None:
        self._size_bytes = size_bytes
        self._bytes_left = most_bytes(size_bytes)
        self._messages_left = max(LEAST_MESSAGES, size_bytes // BYTES_PER_MESSAGE)

    def inside(self, chunk: Any) -> Iterator[Any]:  # noqa: ANN401 - mcap's
        """Yield the records in a chunk, one at a time; whatever mcap raises for damage."""
        from mcap.exceptions import EndOfFile
        from mcap.records import Message
        from mcap.stream_reader import StreamReader

        data = self.content(chunk)
        stream = BytesIO(data)
        with suppress(EndOfFile):
            reader = StreamReader(stream, skip_magic=True, emit_chunks=True, record_size_limit=len(data))
            for record in reader.records:
                if isinstance(record, Message):
                    self.count()
                yield record
                if stream.tell() >= len(data):
                    return

    def content(self, chunk: Any) -> bytes:  # noqa: ANN401 - mcap's
        """Return the unpacked bytes of a chunk whose sum is right."""
        from mcap.stream_reader import get_chunk_data_stream

        data = _unpacked(chunk, self._bytes_left + 1)
        self._bytes_left -= len(data)
        if self._bytes_left < 0:
            raise bomb(self._size_bytes)
        if len(data) < chunk.uncompressed_size:
            raise ValueError("a chunk is shorter than it says")
        get_chunk_data_stream(replace(chunk, compression="", data=data), validate_crc=True)
        return data

    def count(self, messages: int = 1) -> None:
        """Count messages; UnpackingError when they are too many."""
        self._messages_left -= messages
        if self._messages_left < 0:
            raise UnpackingError(
                f"it has {self._size_bytes / 1e6:.1f} MB and more messages than a recording of that size"
            )


def _unpacked(chunk: Any, most: int) -> bytes:  # noqa: ANN401 - mcap's
    match chunk.compression:
        case "zstd":
            import zstandard

            with zstandard.ZstdDecompressor().stream_reader(chunk.data) as stream:
                return stream.read(most)
        case "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=most))
        case "":
            return bytes(chunk.data)
    raise ValueError(f"chunks packed by {chunk.compression!r} cannot be read")
