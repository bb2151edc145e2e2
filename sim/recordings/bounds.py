"""Bound on the memory that a reader of a foreign file may take, whatever the file leads it to."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wallride.runtime.recording.unpacking import bomb, most_bytes
from wallride.sim.recordings.recording import RecordingError


@contextmanager
def bounded_memory(path: Path) -> Iterator[None]:
    """Let this process have as much more memory as a recording of that size can need; RecordingError beyond it."""
    files = [*path.glob("*")] if path.is_dir() else [path]
    size_bytes = sum(file.stat().st_size for file in files if file.is_file())
    before, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = _taken_bytes() + size_bytes + 2 * most_bytes(size_bytes)  # messages, and the arrays made of them
    resource.setrlimit(resource.RLIMIT_AS, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    try:
        yield
    except MemoryError:
        raise RecordingError(f"{path}: {bomb(size_bytes)}.") from None
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, hard))


def _taken_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
