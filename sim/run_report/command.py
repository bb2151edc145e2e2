"""`wallride report`: writes the page and the numbers of a recording."""

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from wallride.runtime.host.output_files import write_answer, write_file
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.figures import truth_of
from wallride.sim.replay.foreign import OpenedRecording, open_any
from wallride.sim.replay.run import run_of
from wallride.sim.run_report.matched_path import told_path
from wallride.sim.run_report.page import page
from wallride.sim.run_report.shown import Shown, shown


def run(options: argparse.Namespace) -> int:
    """Write the page of one run, or of two; RecordingError or SettingsError for an unusable recording."""
    files = [options.file, *([options.beside] if options.beside is not None else [])]
    target: Path = options.output or Path(f"{'-'.join(Path(file).stem for file in files)}.html")
    runs = [_shown(file, tag, options) for file, tag in zip(files, "AB" if len(files) > 1 else ("",), strict=True)]
    text = page(*runs)
    write_file(target, text)
    where = sys.stdout if options.json is None else sys.stderr
    print(f"{target}: {len(text) / 1000:.0f} kB", file=where)
    figures = [one.numbers for one in runs]
    write_answer(json.dumps(figures[0] if len(figures) == 1 else figures, indent=2) + "\n", options.json)
    return 0


def _shown(file: Path, tag: str, options: argparse.Namespace) -> Shown:
    opened: OpenedRecording = open_any(file, options.assignments, options.topic)
    if opened.ours and options.assignments:
        raise RecordingError(
            f"{file} holds the settings of its drive, and a report shows them: leave --set out."
            " `wallride replay --set` decides the drive again with other settings."
        )
    told = shown(run_of(opened.log), _truth(file, options.summary if file == options.file else None), tag)
    return replace(told, run=replace(told.run, path=told_path(opened.log, told.run)))


def _truth(file: Path, summary: Path | None) -> Mapping[str, Any] | None:
    """Return the simulator's figures: of the file named, or of the one beside the recording."""
    path = summary or file.with_suffix(".summary.json")
    if summary is None and not path.is_file():
        return None
    if not path.is_file():
        raise RecordingError(f"--summary {path}: there is no such file; `wallride sim --json` writes one.")
    try:
        found = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} is no summary of `wallride sim --json` ({error}).") from None
    if not isinstance(found, dict):
        raise RecordingError(f"{path} is no summary of `wallride sim --json`.")
    return truth_of(found)
