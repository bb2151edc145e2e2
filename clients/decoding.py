"""Decoder of samples: from bytes to plain values and readable text."""

import dataclasses
import json
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from wallride.runtime.host.extras import how_to_install
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.ros.definitions import TYPES, definition
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import read_beat

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

SHOWN_OF_ARRAY = 6
LONGEST_LINE = 1 << 20
DIGITS = 6
"""Number of decimals, a micrometre or a microsecond: a float32 that was written as 0.1 is read as 0.1."""


class UnreadableError(Exception):
    """A payload that does not fit its topic; the text names the fault."""


def decode(topic: str, payload: bytes) -> dict[str, Any]:
    """Return a message as plain values; UnreadableError for a payload that does not fit the topic."""
    schema = TYPES.get(topic)
    if schema is not None:
        return dict(_plain(message_of(topic, schema, payload)))
    try:
        message = read_beat(payload) if topic == topics.BEAT else topics.decode(payload)
    except (ValueError, TypeError) as error:
        raise UnreadableError(f"{topic}: {len(payload)} bytes that cannot be read ({error})") from None
    return dict(_plain(message))


def as_json(message: Mapping[str, Any]) -> str:
    """Return one line of JSON; numbers that are not finite become null."""
    text = topics.encode(message).decode()
    return text if text.isprintable() else "".join(one if one.isprintable() else json.dumps(one)[1:-1] for one in text)


def as_text(message: Mapping[str, Any], *, whole: bool = False) -> str:
    """Return indented lines in the style of YAML, long arrays shortened unless whole is requested."""
    return "\n".join(one_line(line, LONGEST_LINE) for line in _lines(message, "", whole=whole))


def message_of(topic: str, schema: str, payload: bytes) -> Any:  # noqa: ANN401 - a class that rosbags makes
    """Return a ROS 2 message with its fields; UnreadableError for a payload that is none of this type."""
    try:
        from rosbags.serde import SerdeError
    except ModuleNotFoundError:
        raise UnreadableError(f"{topic}: reading it needs rosbags: {how_to_install('clients')}") from None
    try:
        return _store(schema).deserialize_cdr(payload, schema)
    except SerdeError as error:
        raise UnreadableError(f"{topic}: {len(payload)} bytes that are no {schema} ({error})") from None


@cache
def _store(schema: str) -> "Typestore":
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(schema), schema))
    return store


def _plain(value: object) -> Any:  # noqa: ANN401 - whatever the message holds
    if isinstance(value, np.ndarray):
        return value.astype(np.float64).round(DIGITS).tolist() if value.dtype.kind == "f" else value.tolist()
    if isinstance(value, float):
        return round(value, DIGITS)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = (field.name for field in dataclasses.fields(value))
        # The upper-case ones are the type's constants.
        return {name: _plain(getattr(value, name)) for name in names if name.islower() and name[0] != "_"}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _lines(value: Mapping[str, Any], indent: str, *, whole: bool) -> Iterator[str]:
    for name, item in value.items():
        if isinstance(item, Mapping) and item:
            yield f"{indent}{name}:"
            yield from _lines(item, f"{indent}  ", whole=whole)
        elif isinstance(item, list) and item and isinstance(item[0], Mapping):
            yield f"{indent}{name}:"
            for part in item:
                first, *rest = _lines(part, f"{indent}    ", whole=whole)
                yield f"{indent}  - {first.strip()}"
                yield from rest
        else:
            yield f"{indent}{name}: {_short(item, whole=whole)}"


def _short(item: object, *, whole: bool) -> str:
    if isinstance(item, float):
        return f"{item:.6g}"
    if isinstance(item, list) and len(item) > SHOWN_OF_ARRAY and not whole:
        shown = ", ".join(_short(part, whole=True) for part in item[:SHOWN_OF_ARRAY])
        return f"[{shown}, ... {len(item)} values]"
    if isinstance(item, list):
        return f"[{', '.join(_short(part, whole=True) for part in item)}]"
    return json.dumps(item, ensure_ascii=False, default=str)
