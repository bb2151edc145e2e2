"""Requests about recordings, and their keys: closed forms, shared by the car and its clients.

record       {"on": true|false}, {"by_itself": true} to record by `recording.start` again, or {} for the state alone
logs/list    {}                                             lists the recordings
logs/get     {"name": ..., "offset": ..., "length": ...}    a piece of one file, as it is
logs/trim    {"keep_mb": ...}                               deletes the oldest down to this size
"""

from typing import Annotated

from pydantic import Field, StringConstraints

from wallride.runtime.wire import topics
from wallride.runtime.wire.requests import Request

RECORD = topics.RECORD
LIST = f"{topics.LOGS}/list"
GET = f"{topics.LOGS}/get"
TRIM = f"{topics.LOGS}/trim"
MAX_PIECE_B = 1 << 16
MAX_QUESTION_B = 1024


class RecordQuestion(Request):
    """Request to begin or end a recording, to leave that to the car's settings again, or for its state."""

    on: bool | None = None
    by_itself: bool = False


class ListRecordings(Request):
    """Request for the list of recordings."""


class GetRecording(Request):
    """Request for a piece of a file."""

    name: Annotated[str, StringConstraints(max_length=128)]
    offset: Annotated[int, Field(ge=0, lt=1 << 50)]
    length: Annotated[int, Field(ge=1, le=MAX_PIECE_B)] = MAX_PIECE_B


class TrimQuestion(Request):
    """Request to delete the oldest recordings."""

    keep_mb: Annotated[int, Field(ge=0, le=1 << 30)]
