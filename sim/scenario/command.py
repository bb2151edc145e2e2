"""`wallride lab scenario FILE...`: drives scenarios in virtual time, and says what each expectation came to."""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from wallride.runtime.host.output_files import write_answer
from wallride.runtime.host.terminal_text import USAGE_ERROR, complain
from wallride.sim.scenario.driven import JudgedExpectation, judge, mistakes_after
from wallride.sim.scenario.scenario_file import Scenario, load_scenario
from wallride.sim.scenario.toml_lines import FileMistakeError
from wallride.sim.scenario.virtual_drive import drive_scenario

FAILED, INTERRUPTED = 1, 130
MARKS: Mapping[bool | None, str] = {True: "[green]pass[/green]", False: "[red]FAIL[/red]", None: "[dim]  ? [/dim]"}


def run(options: argparse.Namespace) -> int:
    """Drive all files; 0 when all holds, 1 when an expectation or own law fails, 2 for a mistake, 130 after Ctrl-C."""
    console = Console(stderr=options.json == "-", highlight=False, soft_wrap=True)
    try:
        scenarios = [load_scenario(file, None, options.assignments) for file in options.files]
        results = [_driven(file, scenario, console) for file, scenario in zip(options.files, scenarios, strict=True)]
    except FileMistakeError as error:
        return _mistaken([str(error)])
    except KeyboardInterrupt:
        return INTERRUPTED
    write_answer(json.dumps(results, indent=1) + "\n", options.json)
    mistakes = [words for result in results for words in result["mistakes"]]
    if mistakes:
        return _mistaken(mistakes)
    return 0 if all(result["passed"] for result in results) else FAILED


def _mistaken(mistakes: Sequence[str]) -> int:
    for words in mistakes:
        complain(words)
    return USAGE_ERROR


def _driven(file: Path, scenario: Scenario, console: Console) -> dict[str, Any]:
    """Drive one file's scenario, print what came of it, and return it for the JSON file."""
    began_s = time.monotonic()
    with redirect_stdout(sys.stderr):  # what a law prints is no answer of the program's
        driven = drive_scenario(scenario)
    judged = judge(scenario, driven)
    took_s = time.monotonic() - began_s
    console.print(
        f"{escape(str(file))}: {driven.time_s[-1]:.1f} s in {scenario.content.world}, driven in {took_s:.1f} s"
    )
    tell(file, judged, console)
    if driven.law_fault:
        console.print(f"  {MARKS[False]} {escape(f'{file.name}: {driven.law_fault}')}")
    return {
        "file": str(file),
        "passed": all(one.holds is not False for one in judged) and not driven.law_fault,
        "law_fault": driven.law_fault,
        "mistakes": mistakes_after(scenario, driven),
        "expectations": [{"line": one.line, "holds": one.holds, "words": one.words} for one in judged],
    }


def tell(file: Path, judged: Sequence[JudgedExpectation], console: Console) -> None:
    """Print each expectation with its line."""
    for one in judged:
        console.print(f"  {MARKS[one.holds]} {escape(f'{file.name}:{one.line}: {one.words}')}")
    if not judged:
        console.print(escape("  no [[expect]] in it"))
