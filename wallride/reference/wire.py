"""The parts of the topics' page for programs in other languages: requests with their answers, and messages by bytes."""

import asyncio
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from struct import calcsize
from typing import Any, Final

from wallride.runtime.parameters import requests as of_parameters
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.server import ParameterServer, ServerContext
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording import requests as of_recordings
from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.mcap_file import McapFile
from wallride.runtime.recording.recorder import Recorder
from wallride.runtime.restarting import ProcessRestart
from wallride.runtime.settings.recording import RecordingSettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks.recorder import Library
from wallride.runtime.wire import topics
from wallride.runtime.wire.requests import Request

Field = tuple[str, str, str]
EXAMPLE_FOLDER: Final = "/var/lib/wallride"
EXAMPLE_NAME: Final = "20261121T084600Z-b0007-00042.mcap"
GET_BYTES: Final = of_recordings.MAX_PIECE_B
COMMAND_FIELDS: Final[Sequence[Field]] = (
    ("magic", "4s", '"WRC1": the version is in it'),
    ("session", "Q", "random for each start of the client, not 0"),
    ("sequence", "I", "first 1, then one more each"),
    ("car_session", "I", "copied from the newest beat; 0 before the first"),
    ("beat", "I", "copied from the newest beat; 0 before the first"),
    ("flags", "B", "1 manual, 2 autonomy, 4 e-stop, 8 reset, 16 take over, 32 goodbye, 64 unsure; 0: all released"),
    ("input", "B", "0 pad, 1 keyboard, 2 page, 3 script"),
    ("input_age_ms", "H", "since the device's last event; 65535: unknown"),
    ("speed_mps", "f", "positive forward"),
    ("steering_rad", "f", "positive to the left"),
    ("name", "24s", "UTF-8, filled up with zeros"),
)
BEAT_FIELDS: Final[Sequence[Field]] = (
    ("magic", "4s", '"WRB1": the version is in it'),
    ("car_session", "I", "random for each start of the car"),
    ("beat", "I", "one more each"),
    ("flags", "B", "1 e-stop latched, 2 permitted, 4 operator present, 8 operator lost, 16 release first, 32 fault"),
    ("operator_session", "Q", "whose commands count; 0: no operator"),
    ("acknowledged", "I", "newest sequence of the operator"),
    ("acknowledged_age_ms", "H", "since its arrival; 65535: never"),
    ("speed_mps", "f", "measured; NaN: unknown"),
    ("operator_name", "24s", "UTF-8, filled up with zeros"),
)
_KP: Final = "wall_follow.kp"
_WORDS: Final = {
    "4s": "4 bytes",
    "24s": "24 bytes",
    "Q": "uint64",
    "I": "uint32",
    "H": "uint16",
    "B": "uint8",
    "f": "float32",
}
REQUESTS: Final[Mapping[str, type[Request]]] = {
    f"{topics.PARAM}/list": of_parameters.ListParameters,
    f"{topics.PARAM}/get": of_parameters.GetParameters,
    f"{topics.PARAM}/set": of_parameters.SetQuestion,
    f"{topics.PARAM}/history": of_parameters.HistoryQuestion,
    f"{topics.PARAM}/save": of_parameters.SaveQuestion,
    f"{topics.PARAM}/configure": of_parameters.ConfigureQuestion,
    f"{topics.PARAM}/restart": of_parameters.RestartQuestion,
    of_recordings.RECORD: of_recordings.RecordQuestion,
    of_recordings.LIST: of_recordings.ListRecordings,
    of_recordings.GET: of_recordings.GetRecording,
    of_recordings.TRIM: of_recordings.TrimQuestion,
}


def layout(fields: Sequence[Field]) -> str:
    """Return the layout of a message as `struct` has it."""
    return "<" + "".join(letter for _, letter, _ in fields)


def wire_sections() -> list[str]:
    """Return the lines of both parts."""
    lines = ["## Requests\n", "A refusal is an error reply with its reason as text. Unknown keys are refused.\n"]
    answers = _answers()
    for key, kind in REQUESTS.items():
        lines += [f"`{key}`, the request's JSON schema{' and an answer' if key in answers else ''}:\n", "```json"]
        lines += [json.dumps(_plain(kind.model_json_schema()))]
        lines += [answers[key]] if key in answers else []
        lines += ["```", ""]
    lines += ["Both messages in JavaScript: [teleop_bytes.mjs](../examples/teleop_bytes.mjs).\n"]
    lines += _table(f"`{topics.COMMAND}` and `{topics.PLANNER}/NAME/command`", COMMAND_FIELDS)
    lines += _table(f"`{topics.BEAT}`", BEAT_FIELDS)
    return lines


def _table(subject: str, fields: Sequence[Field]) -> list[str]:
    lines = [
        f"## Bytes of {subject}\n",
        "Little endian, without gaps.\n",
        "| at | type | field | meaning |",
        "| --- " * 4 + "|",
    ]
    at = 0
    for name, letter, meaning in fields:
        lines.append(f"| {at} | {_WORDS[letter]} | `{name}` | {meaning} |")
        at += calcsize(f"<{letter}")
    return [*lines, ""]


def _plain(schema: Any) -> Any:  # noqa: ANN401 - JSON
    """Return a schema without titles and descriptions."""
    if isinstance(schema, dict):
        return {key: _plain(part) for key, part in schema.items() if key == "type" or not isinstance(part, str)}
    return [_plain(part) for part in schema] if isinstance(schema, list) else schema


def _answers() -> dict[str, str]:
    """Return answers of a car's own servers, which are asked here; paths and sizes are those of an example."""
    with tempfile.TemporaryDirectory(prefix="wallride-") as folder:
        made = {**asyncio.run(_of_parameters(Path(folder))), **asyncio.run(_of_recordings(Path(folder)))}
    return {key: answer.replace(folder, EXAMPLE_FOLDER) for key, answer in made.items()}


async def _of_parameters(folder: Path) -> dict[str, str]:
    file = folder / "car.toml"
    file.write_text("", encoding="utf-8")
    car = ServerContext(
        lambda _settings, _names: None, lambda: True, lambda: 12.5, lambda: "2026-01-31 12:00:00", file
    )  # fmt: skip
    server = ParameterServer(Settings(), car, ChangeHistory(1))
    asked = {
        "list": (server.list_all, {"under": _KP}),
        "get": (server.get_some, {"names": [_KP]}),
        "set": (server.set_some, {"values": {_KP: 10.0}, "by": "ann"}),
        "history": (server.past, {"most": 1}),
    }
    made = {what: ask(json.dumps(question).encode()).decode() for what, (ask, question) in asked.items()}
    made["save"] = (await server.save(b'{"by": "ann"}')).decode()
    wish = json.dumps({"values": {"recording.raw": True}, "by": "ann"}).encode()
    made["configure"] = (await server.configure(wish)).decode()
    made["restart"] = (await RestartDesk(str, ProcessRestart(file, None, ())).receive(b'{"by": "ann"}')).decode()
    return {f"{topics.PARAM}/{what}": answer for what, answer in made.items()}


async def _of_recordings(folder: Path) -> dict[str, str]:
    zero = WallClock(lambda: 0.0, lambda: 0)
    settings = RecordingSettings(folder=str(folder), keep_free_mb=0)
    recorder = Recorder(settings, car="car1", version="0.1.0", wall_clock=zero, clock=lambda: 12.5)
    recorder.folder.mkdir(parents=True, exist_ok=True)
    McapFile(recorder.folder / EXAMPLE_NAME, Disk(), {}, "wallride").close()
    library = Library(recorder)
    listed = json.loads(await library.list_all(b"{}"))
    listed["files"][0] |= {"size_bytes": 3_500_000, "duration_s": 60.0}
    answers = {
        of_recordings.RECORD: (await library.record(b"{}")).decode(),
        of_recordings.LIST: json.dumps(listed, separators=(",", ":")),
        of_recordings.TRIM: (await library.trim(b'{"keep_mb": 0}')).decode(),
    }
    return {**answers, of_recordings.GET: f"at most {GET_BYTES} bytes of the file as they are, none behind its end"}
