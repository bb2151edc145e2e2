"""Decoder of recorded messages, by the very definitions with which they were written."""

from functools import cache
from typing import TYPE_CHECKING, Any

from wallride.runtime.ros.definitions import definition
from wallride.sim.replay.drive_log import LoggedMessage

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


def decode(message: LoggedMessage) -> Any:  # noqa: ANN401 - built at run time by the type store
    """Return a CDR message as an object with the fields of its type."""
    return _store(message.schema).deserialize_cdr(message.payload, message.schema)


def stamp_ns(decoded: Any) -> int:  # noqa: ANN401 - any message with a header
    """Return a header's stamp, ns since 1970."""
    stamp = decoded.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


@cache
def _store(schema: str) -> "Typestore":
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(schema), schema))
    return store
