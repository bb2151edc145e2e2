"""The message type of each topic, and the text of every type, for recording and decoding."""

from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from types import MappingProxyType

from wallride.runtime.wire import topics

SCHEMA_ENCODING = "ros2msg"
"""Name, in recorders and viewers (MCAP, Foxglove), of the form in which `definition` describes a type."""

TYPES: Mapping[str, str] = MappingProxyType(
    {name: topic.schema for name, topic in topics.TELEMETRY.items() if topic.schema}
)
"""Topics that carry CDR; the others are JSON (status, decision) or wallride's own format (beat)."""

_SEPARATOR = "=" * 80


def encoding(topic: str) -> str:
    """Return the zenoh encoding of a topic's samples: the bytes' format and, after a semicolon, their schema."""
    schema = TYPES.get(topic)
    return f"application/cdr;{schema}" if schema is not None else "application/json"


@lru_cache(maxsize=len(TYPES))
def definition(schema: str) -> str:
    """Return the text of a type and of all its parts, in the form that MCAP calls ros2msg.

    schema: such as sensor_msgs/msg/LaserScan; KeyError for a type that wallride does not use.
    """
    fields = _all_fields()
    names = [schema.replace("/msg/", "/")]
    for name in names:  # grows during the loop
        names += [part for part in dict.fromkeys(_parts(fields[name])) if part not in names]
    blocks = [fields[name] if not i else f"MSG: {name}\n{fields[name]}" for i, name in enumerate(names)]
    return f"{_SEPARATOR}\n".join(blocks)


def _parts(fields: str) -> list[str]:
    kinds = (line.split()[0].split("[")[0] for line in fields.splitlines())
    return [kind for kind in kinds if "/" in kind]


@lru_cache(maxsize=1)
def _all_fields() -> dict[str, str]:
    """Return the fields of every type in types.msg, by name."""
    text = resources.files("wallride.runtime.ros").joinpath("types.msg").read_text(encoding="utf-8")
    blocks = (block.split("\n", 1) for block in text.split("=== ")[1:])
    return {name.strip(): fields.strip() + "\n" for name, fields in blocks}
