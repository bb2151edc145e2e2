"""`wallride logs` and `wallride record`: lists and fetches recordings, and starts or stops one on a car."""

import argparse
import asyncio
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wallride.clients.answers import asked, reading
from wallride.clients.connection import ConnectionProblemError, connected
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.recording import requests
from wallride.runtime.recording.file_summary import duration_s
from wallride.runtime.recording.recover import RecoveryError, file_state, is_whole, recover
from wallride.runtime.recording.ring import ENDING, KEPT, MB, Entry, entries, file_named, folders, keep, parse, trim
from wallride.runtime.settings.recording import recordings_folder
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError

TRIES = 5
PART = ".part"
Answer = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ListedRecording:
    """One recording, on this machine or on a car. state: whole, unfinished or recording.

    duration_s: None for one without its end, or of a car that does not say it.
    """

    name: str
    size_bytes: int
    black_box: bool
    reason: str
    state: str
    duration_s: float | None = None


async def run(options: argparse.Namespace) -> int:
    """Run `wallride logs ACTION`; options as of `wallride.logs_options`."""
    match options.action:
        case "info":
            from wallride.clients.log_info import describe

            for path in options.files:
                options.print_line(describe(_found(path), as_json=options.json))
            return 0
        case "recover":
            return _recover(options.files, options)
        case "keep":
            return _keep(options)
        case _ if options.local is not None:
            return _here(options)
        case _:
            return await _there(options)


async def record(options: argparse.Namespace) -> int:
    """Run `wallride record start|stop|status`."""
    wishes = {"start": {"on": True}, "stop": {"on": False}, "status": {}}
    async with connected(options, asks=True) as (bus, car):
        status = await _ask_json(bus, car, requests.RECORD, **wishes[options.action])
    with reading(car, "answer"):
        options.print_line(json.dumps(status) if options.json else one_line(_standing(status)))
        done = options.action == "status" or status["on"] is (options.action == "start")
    return 0 if done else 1


def _standing(status: Answer) -> str:
    details = [status["words"]]
    if status["file"]:
        details.append(f"{status['file']}, {status['written_mb']:.1f} MB")
    if status["black_box"]:
        details.append(f"black box {status['black_box']}")
    return "; ".join(details)


def _here(options: argparse.Namespace) -> int:
    """List or trim a folder of this machine."""
    above = Path(options.local) if options.local else recordings_folder("")
    if options.action == "get":
        raise ConnectionProblemError(f"what --local names is here already: {above}")
    if options.local and not above.is_dir():
        raise ConnectionProblemError(f"{above}: no such folder")
    places = folders(above)
    if options.action == "trim":
        found = [trim(folder, options.keep_mb * MB) for folder in places if folder.name != KEPT]
        refused = {name: why for one in found for name, why in one.refused.items()}
        return _say_gone([name for one in found for name in one.deleted], refused, options)
    _say_list([listed for folder in places for listed in _listed_in(folder, above, options)], str(above), options)
    return 0


def _listed_in(folder: Path, above: Path, options: argparse.Namespace) -> list[ListedRecording]:
    try:
        return [_listed(folder, entry, above) for entry in entries(folder)]
    except OSError as error:
        if not options.json:
            options.print_line(f"{folder}: cannot be read: {error.strerror}")
        return []


def _listed(folder: Path, entry: Entry, above: Path) -> ListedRecording:
    path = folder / entry.name
    name = path.relative_to(above).as_posix()
    return ListedRecording(name, entry.size_bytes, entry.is_black_box, entry.reason, file_state(path), duration_s(path))


def _keep(options: argparse.Namespace) -> int:
    """Move recordings out of their ring, which would delete them one day."""
    for path in options.files:
        found = _found(path)
        try:
            options.print_line(f"kept: {keep(found)}")
        except OSError as error:
            raise ConnectionProblemError(f"{found}: {error.strerror or error}") from None
    return 0


async def _there(options: argparse.Namespace) -> int:
    """List, get or trim the recordings of a car."""
    async with connected(options, asks=True) as (bus, car):
        if options.action == "trim":
            answer = await _ask_json(bus, car, requests.TRIM, keep_mb=options.keep_mb)
            with reading(car, "answer"):
                return _say_gone(answer["deleted"], answer.get("refused", {}), options)
        answer = await _ask_json(bus, car, requests.LIST)
        with reading(car, "list"):
            files = [_listed_there(fields) for fields in answer["files"]]
            if options.action == "list":
                _say_list(files, f"{car}:{answer['folder']}", options)
                return 0
        for chosen in _chosen(files, options):
            path = await _fetch(bus, car, chosen, options)
            options.print_line(str(path))
    return 0


def _listed_there(fields: Mapping[str, Any]) -> ListedRecording:
    """Return a recording as a car lists it; TypeError for what is none."""
    if not isinstance(fields["name"], str) or not isinstance(fields["size_bytes"], int):
        raise TypeError("not a recording")
    return ListedRecording(**fields)


def _chosen(files: Sequence[ListedRecording], options: argparse.Namespace) -> list[ListedRecording]:
    by_name = {file.name: file for file in files}
    if unknown := [name for name in options.names if name not in by_name]:
        raise ConnectionProblemError(f"{', '.join(unknown)}: the car has no such recording; see wallride logs list")
    if options.names:
        return [by_name[name] for name in options.names]
    boxes, drives = ([file for file in files if file.black_box is kind] for kind in (True, False))
    wanted = boxes if options.black_boxes else drives
    if not wanted:
        raise ConnectionProblemError("the car has no recording of that kind")
    return wanted[-options.last :]


async def _fetch(bus: Bus, car: str, file: ListedRecording, options: argparse.Namespace) -> Path:
    """Fetch one file, resuming an earlier attempt; an unfinished one is completed on this machine."""
    if parse(file.name) is None:  # a car must not choose the place of files on this machine
        raise ConnectionProblemError(f"{car} offers {file.name!r}, which is not the name of a recording")
    target = Path(options.output) / car / file.name
    part = target.with_name(target.name + PART)
    try:
        begins = await _piece(bus, car, file, 0)
        if target.exists() and target.stat().st_size >= file.size_bytes:
            if _begins_alike(target, begins):
                return target
            raise ConnectionProblemError(f"{target}: is another recording of that name; fetch into another folder: -o")
        part.parent.mkdir(parents=True, exist_ok=True)
        if part.exists() and not (part.stat().st_size <= file.size_bytes and _begins_alike(part, begins)):
            part.unlink()
        with part.open("ab") as out:
            while (offset := out.tell()) < file.size_bytes:
                piece = begins if offset == 0 else await _piece(bus, car, file, offset)
                if not piece:
                    raise ConnectionProblemError(f"{file.name}: it became shorter on the car; try again")
                out.write(piece)
                options.progress(file.name, out.tell(), file.size_bytes)
        if not is_whole(part):
            recover(part)
        part.replace(target)
    except OSError as error:
        raise ConnectionProblemError(f"{part}: cannot be written: {error.strerror or error}") from None
    except RecoveryError as error:
        raise ConnectionProblemError(str(error)) from None
    return target


def _begins_alike(path: Path, begins: bytes) -> bool:
    """Tell whether a file here is of the same recording: two cars without a clock give equal names to theirs."""
    with path.open("rb") as file:
        found = file.read(len(begins))
    return begins.startswith(found)


async def _piece(bus: Bus, car: str, file: ListedRecording, offset: int) -> bytes:
    """Request a piece; at most as much as was asked for is taken."""
    length = max(1, min(requests.MAX_PIECE_B, file.size_bytes - offset))
    return (await _ask_some_times(bus, car, name=file.name, offset=offset, length=length))[:length]


async def _ask_some_times(bus: Bus, car: str, **question: object) -> bytes:
    """Request a piece repeatedly: a short loss of the radio link loses one answer."""
    for _ in range(TRIES - 1):
        try:
            return await _ask(bus, car, requests.GET, question)
        except ConnectionProblemError:
            await asyncio.sleep(0.1)
    return await _ask(bus, car, requests.GET, question)


async def _ask_json(bus: Bus, car: str, what: str, **question: object) -> Answer:
    answer = await _ask(bus, car, what, question)
    with reading(car, "answer"):
        return topics.decode(answer)


async def _ask(bus: Bus, car: str, what: str, question: Mapping[str, object]) -> bytes:
    try:
        return await asked(bus, car, what, json.dumps(question).encode())
    except RefusedError as error:
        raise ConnectionProblemError(f"{car}: {error}") from None


def _recover(files: Sequence[Path], options: argparse.Namespace) -> int:
    failed = 0
    for path in files:
        try:
            found = recover(_found(path))
        except RecoveryError as error:
            options.print_line(str(error))
            failed = 1
            continue
        damaged = f"; {found.damaged} damaged pieces cannot be read" if found.damaged else ""
        if found.was_whole:
            options.print_line(f"{path}: is whole; {found.messages} messages{damaged}")
        else:
            options.print_line(
                f"{path}: finished; {found.messages} messages kept, a torn end of {found.cut_bytes} bytes cut"
                f" off{damaged}"
            )
    return failed


def _found(path: Path) -> Path:
    """Return the path of a recording that may be named as in the list."""
    if (found := file_named(path, recordings_folder(""))) is not None:
        return found
    if path.is_dir():
        raise ConnectionProblemError(f"{path}: is a folder; name its recordings, for example {path}/*{ENDING}")
    raise ConnectionProblemError(f"{path}: no such file here (wallride logs get brings it from the car)")


def _say_gone(names: Sequence[str], refused: Mapping[str, str], options: argparse.Namespace) -> int:
    for name in names:
        options.print_line(one_line(f"deleted {name}"))
    for name, why in refused.items():
        options.print_line(one_line(f"not deleted {name}: {why}"))
    if not names and not refused:
        options.print_line("nothing to delete")
    return 1 if refused and not names else 0


def _say_list(files: Sequence[ListedRecording], where: str, options: argparse.Namespace) -> None:
    if options.json:
        options.print_line(json.dumps([asdict(file) for file in files], indent=2))
        return
    for file in files:
        state = "" if file.state == "whole" else f"   {file.state}"
        state += "   black box of a stop" if file.black_box else ""
        lasted = "-" if file.duration_s is None else f"{file.duration_s:.1f} s"
        options.print_line(one_line(f"{file.size_bytes / MB:9.1f} MB  {lasted:>9}  {file.name}{state}"))
    total_mb = sum(file.size_bytes for file in files) / MB
    boxes = sum(file.black_box for file in files)
    also = f" and {boxes} black box{'es' if boxes > 1 else ''}" if boxes else ""
    options.print_line(f"{len(files) - boxes} recordings{also}, {total_mb:.1f} MB in {one_line(where)}")
