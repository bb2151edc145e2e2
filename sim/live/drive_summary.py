"""Summary of a simulated drive: its figures as one dictionary, as a table for people, as JSON, and as a picture."""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from wallride.runtime.arbitration.command import NO_WINNER
from wallride.runtime.settings.tree import Settings
from wallride.runtime.telemetry.screen_words import because
from wallride.sim.figures.summary import device_faults
from wallride.sim.live.record import Record
from wallride.sim.world.place import World

HEARD = "heard"
"""Value of telemetry in the summary: its statements about the runtime are that runtime's own."""
FOR_PROGRAMS = frozenset({"began_unix_s", "session"})
"""Fields of the summary that only its JSON file has."""
ROUND_FROM = 1000.0


def summarize(record: Record, settings: Settings) -> dict[str, Any]:
    """Return the figures that every drive has. settings: those at the start."""
    status = record.telemetry.get("status")
    winners = (status or {}).get("seconds_by_winner", {})
    driven = record.sums.figures()
    return {
        "method": settings.wall_follow.method,
        "side": settings.wall_follow.side,
        "began_unix_s": round(record.began_unix_s, 3),
        **driven,
        **({"stands_because": _stands_because((status or {}).get("output"))} if driven["stopped"] else {}),
        "scan_to_motor_ms": record.latency.summary_ms(),
        "telemetry": HEARD if status else f"drove without telemetry: {record.unheard}",
        "session": record.address.session if record.address is not None else None,
        "scans_sent": record.scans,
        "scans_driven": status.get("scans") if status else None,
        "winners": {name: round(seconds, 2) for name, seconds in winners.items()} if status else None,
        "faults": device_faults(status) if status else None,
    }


def _stands_because(decision: Mapping[str, Any] | None) -> str | None:
    """Return the car's last decision in the words of a screen, None where none was heard."""
    if decision is None:
        return None
    return f"{decision.get('winner') or 'none'}: {because(str(decision.get('reason')), decision.get('measure'))}"


def write_summary(summary: dict[str, Any], target: str | None) -> None:
    """Write the summary as JSON; "-" is standard output, None nowhere."""
    if target is None:
        return
    text = json.dumps(summary, indent=2) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        Path(target).write_text(text)


def plot_drive(path: Path, world: World, record: Record, settings: Settings) -> None:
    """Write a picture of the way driven and the distance error."""
    from wallride.sim.figures.drawing import save_plot

    samples, wanted_m = record.track.samples, record.wanted_m()
    track = np.array([[s.x_m, s.y_m, s.yaw_rad] for s in samples]).reshape(-1, 3)
    times_s = np.array([s.time_s for s in samples])
    errors_m = np.array([s.wall_m - wanted_m(s.time_s) for s in samples])
    follow = settings.wall_follow
    title = f"{world.name}: {follow.method}, {follow.side}, {follow.desired_distance_m:g} m"
    save_plot(path, world, track, times_s, errors_m, title)


def summary_table(summary: dict[str, Any]) -> Table:
    """Return the summary as a table."""
    table = Table(title=f"wallride sim: {summary['world']}", show_header=False)
    for name, value in summary.items():
        if name not in FOR_PROGRAMS and value not in ([], {}):
            table.add_row(name, shown(_winners_in_words(value) if name == "winners" else value))
    return table


def _winners_in_words(winners: Mapping[str, float] | None) -> Mapping[str, float] | None:
    """Return the seconds by winner under the names of a screen; JSON keeps those of the wire."""
    return winners and {"none" if name == NO_WINNER else name: seconds for name, seconds in winners.items()}


def shown(value: object) -> str:
    """Return a value of the summary for people; the JSON file has all digits."""
    match value:
        case None:
            return "-"
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.0f}" if abs(value) >= ROUND_FROM else f"{value:.3g}"
        case dict():
            return ", ".join(f"{key} {shown(one)}" for key, one in value.items())
        case list():
            return ", ".join(shown(one) for one in value)
    return str(value)
