"""A recording read like a car: the same topics, the same values, whole or cut off at any byte."""

import tomllib
import warnings
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.values import Value, value_of
from wallride.clients.topics import KINDS
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.channels import SETTINGS, STRING, text_of
from wallride.runtime.recording.mcap_reading import Damage, LoggedRecord, McapReader
from wallride.runtime.recording.unpacking import UnpackingError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class _Raw:
    topic: str
    schema: str
    at_s: float
    data: bytes

    def value(self) -> Value:
        payload = text_of(self.data) if self.schema == STRING else self.data
        return value_of(self.topic, payload, self.at_s)


class RecordedStream(Generic[T]):
    """Yields from the beginning each time it is iterated, for `for` and `async for`."""

    def __init__(self, begin: Callable[[], Iterator[T]]) -> None:
        self._begin = begin

    def __iter__(self) -> Iterator[T]:
        return self._begin()

    async def __aiter__(self) -> AsyncIterator[T]:
        for item in self._begin():
            yield item


class RecordedCar:
    """The reading half of a `RemoteCar`, over a file. name: the file's; parameters: the settings in force at its start.

    ConnectionProblemError when the file cannot be read or holds nothing of a car.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path).expanduser()
        self.name = self.path.name
        if not self.topic_names:
            raise ConnectionProblemError(f"{self.path}: holds no message of a car; a recording ends with .mcap")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open between two iterations."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        """Nothing is open between two iterations."""

    @cached_property
    def topic_names(self) -> tuple[str, ...]:
        """Return the topics in the file."""
        return tuple(sorted({raw.topic for raw in self._messages() if raw.topic in KINDS}))

    @cached_property
    def parameters(self) -> Mapping[str, Any]:
        """Return the settings at the beginning, by their dotted names."""
        text = next((text_of(raw.data) for raw in self._messages() if raw.topic == SETTINGS), b"")
        return dict(_flat(tomllib.loads(text.decode())))

    def close(self) -> None:
        """Do nothing, for programs that read cars as well: nothing is open between two iterations."""

    def topic(self, name: str, **_: object) -> RecordedStream[Any]:
        """Return an iterable over the values of a topic, in the order of the file; options of a car do nothing."""
        self._check((name,))
        return RecordedStream(lambda: (raw.value() for raw in self._messages() if raw.topic == name))

    def topics(self, *names: str, **_: object) -> RecordedStream[tuple[str, Any]]:
        """Return an iterable over topic and value of several topics, in the order of the file."""
        self._check(names)
        return RecordedStream(lambda: ((raw.topic, raw.value()) for raw in self._messages() if raw.topic in names))

    def latest(self, name: str, **_: object) -> Any:  # noqa: ANN401 - a value of the topic
        """Return the last value of a topic."""
        self._check((name,))
        last = None
        for raw in self._messages():
            last = raw if raw.topic == name else last
        if last is None:
            raise ConnectionProblemError(f"{self.path}: holds nothing on {name}")
        return last.value()

    def _check(self, names: tuple[str, ...]) -> None:
        if missing := [name for name in names if name not in self.topic_names]:
            raise ConnectionProblemError(
                f"{self.path}: holds nothing on {', '.join(missing)}; there are {', '.join(self.topic_names)}"
            )

    def _messages(self) -> Iterator[_Raw]:
        """Yield the messages as far as the file is complete, with a warning for each piece inside that is damaged."""
        try:
            for found in McapReader(self.path):
                match found:
                    case LoggedRecord():
                        yield _Raw(found.topic.strip("/"), found.schema, found.record.log_time / NS, found.record.data)
                    case Damage(is_end=False):
                        words = f"{found.duration_s:.1f} s of messages are damaged and left out ({found.reason})"
                        warnings.warn(f"{self.path}: {words}", stacklevel=2)
                    case _:
                        pass
        except OSError as error:
            raise ConnectionProblemError(f"{self.path}: cannot be read: {error.strerror or error}") from None
        except UnpackingError as error:
            raise ConnectionProblemError(f"{self.path}: {error}") from None


def _flat(tree: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def open_recording(path: Path | str) -> RecordedCar:
    """Open a recording (.mcap) of a car; ConnectionProblemError when it holds nothing of one."""
    return RecordedCar(path)
