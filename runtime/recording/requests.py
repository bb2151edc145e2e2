"""What may be asked about recordings, and where: closed forms, shared by the car and those who ask it.

record       {"on": true|false}, or {} to hear how it stands
logs/list    {}                                             what there is
logs/get     {"name": ..., "offset": ..., "length": ...}    a piece of one file, as it is
logs/trim    {"keep_mb": ...}                               the oldest go until no more is left
"""

from typing import Annotated

from pydantic import Field, StringConstraints

from runtime.wire import topics
from runtime.wire.requests import Request

RECORD = topics.RECORD
LIST = f"{topics.LOGS}/list"
GET = f"{topics.LOGS}/get"
TRIM = f"{topics.LOGS}/trim"
MAX_PIECE_B = 1 << 16
MAX_QUESTION_B = 1024


class RecordQuestion(Request):
    """Begin, end, or only say."""

    on: bool | None = None


class ListRecordings(Request):
    """Which recordings there are."""


class GetRecording(Request):
    """A piece of a file, please."""

    name: Annotated[str, StringConstraints(max_length=128)]
    offset: Annotated[int, Field(ge=0, lt=1 << 50)]
    length: Annotated[int, Field(ge=1, le=MAX_PIECE_B)] = MAX_PIECE_B


class TrimQuestion(Request):
    """Make room."""

    keep_mb: Annotated[int, Field(ge=0, le=1 << 30)]
