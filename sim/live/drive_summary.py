"""Summary of a simulated drive: its figures as one dictionary, as a table for people, as JSON, and as a picture."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from wallride.runtime.arbitration.command import NO_WINNER
from wallride.runtime.control.line_following.line_follower import DRIVES, JOINS
from wallride.runtime.settings.tree import Settings
from wallride.runtime.telemetry.screen_words import because, times
from wallride.sim.figures.summary import OF_THE_WALL, SETTLE_BAND_M, SETTLED_FOR_S, count_words, device_faults, digits
from wallride.sim.live.record import Record
from wallride.sim.world.place import World

HEARD = "heard"
"""Value of telemetry in the summary: its statements about the runtime are that runtime's own."""
FOR_PROGRAMS = frozenset({"began_unix_s", "session", "world", "recording", "seconds_by_reason", "failed"})
"""Fields of the summary that have no row in the table."""
NOT_RECORDING, ENDED, TRYING = "NOT recording: ", "not recording: ", "; trying again"
UNDER_WAY = frozenset({DRIVES, JOINS, "wall"})
"""Reasons of a car that nothing keeps."""
DEVICES_ALLOW = "the lidar allows ", "the motor allows "
"""Beginnings of the notices of the status that tell a bound of the speed."""
NOT_BY_A_WALL = frozenset({"line", "corridor"})
"""Laws that keep no distance from a wall."""
MOST_REASONS, LEAST_REASON_S = 3, 1.0
Words = Callable[[Any], str]


def summarize(record: Record, settings: Settings) -> dict[str, Any]:
    """Return the figures that every drive has. settings: those at the start."""
    status = record.telemetry.get("status")
    winners = (status or {}).get("seconds_by_winner", {})
    methods = record.values_of("wall_follow.method", settings.wall_follow.method)
    sides = record.values_of("wall_follow.side", settings.wall_follow.side)
    left_out = OF_THE_WALL if len(sides) > 1 or NOT_BY_A_WALL.intersection(methods) else frozenset()
    driven = {name: value for name, value in record.sums.figures().items() if name not in left_out}
    stands = driven["stopped"] and not record.failed  # the last decision of a runtime that died is no reason
    return {
        "method": ", then ".join(methods),
        "side": ", then ".join(sides),
        "began_unix_s": round(record.began_unix_s, 3),
        **driven,
        "standing_s": round(record.sums.standing_s, 2),
        **({"stands_because": _stands_because((status or {}).get("output"))} if stands else {}),
        "scan_to_motor_ms": record.latency.summary_ms(),
        "telemetry": HEARD if status else f"drove without telemetry: {record.unheard}",
        "failed": record.failed,
        "session": record.address.session if record.address is not None else None,
        "scans_sent": record.scans,
        "scans_driven": status.get("scans") if status else None,
        "winners": {name: round(seconds, 2) for name, seconds in winners.items()} if status else None,
        "seconds_by_reason": {name: round(seconds, 2) for name, seconds in record.reasons_s.items()},
        "speed_bounds": [words for words in (status or {}).get("window", ()) if words.startswith(DEVICES_ALLOW)],
        "hard_stops": record.hard_stops,
        "faults": device_faults(status) | dict(record.own_faults) if status else None,
        "held_up": record.held_up.words,
        "recording": _recording((status or {}).get("recording"), record.recorded),
    }


def laps_missing(summary: Mapping[str, Any], wanted: int | None) -> str:
    """Return how many of the wanted laps were driven, and what kept the car from more; "" where none is missing."""
    if wanted is None or summary["laps"] >= wanted:
        return ""
    stops = summary["hard_stops"]
    why = ["it touched something"] if summary["collided"] else []
    why += [f"{stops} hard stop{'s' if stops > 1 else ''}"] if stops else []
    why += _kept_by(summary["seconds_by_reason"])
    driven = f"{summary['laps']} of {wanted} laps in {summary['duration_s']:.0f} s"
    return f"{driven}; {'; '.join(why)}" if why else f"{driven}; more time: --duration"


def along_the_line(reasons_s: Mapping[str, float]) -> dict[str, Any]:
    """Return for how long a car drove its race line, and what kept it otherwise. reasons_s: as of `Record`."""
    return {"raced_s": round(reasons_s.get(DRIVES, 0.0), 2), "kept_by": _kept_by(reasons_s)}


def _kept_by(reasons_s: Mapping[str, float]) -> list[str]:
    told = sorted(reasons_s.items(), key=lambda one: -one[1])
    kept = [
        f"{seconds:.0f} s: {reason}"
        for reason, seconds in told
        if reason not in UNDER_WAY and seconds >= LEAST_REASON_S
    ]
    return kept[:MOST_REASONS]


def _stands_because(decision: Mapping[str, Any] | None) -> str | None:
    """Return the car's last decision in the words of a screen, None where none was heard."""
    if decision is None:
        return None
    return f"{decision.get('winner') or 'none'}: {because(str(decision.get('reason')), decision.get('measure'))}"


def _recording(status: Mapping[str, Any] | None, recorded: Sequence[str]) -> dict[str, Any] | None:
    """Return the last file's name, "" without one, and the recorder's words; None where nothing was heard of it.

    is_open: whether that file is being written, whatever the words say of an earlier one or of a black box.
    """
    if not status:
        return None
    open_file, ended = status.get("file") or "", recorded[-1] if recorded else ""
    return {"file": open_file or ended, "words": status.get("words") or "", "is_open": bool(open_file)}


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
    """Return the summary as a table for people: in words, with units."""
    table = Table(title=f"wallride sim: {summary['world']}", show_header=False)
    for name, value in summary.items():
        label, words = ROWS.get(name, (name.replace("_", " "), shown))
        if name not in FOR_PROGRAMS and value not in ([], {}) and (text := words(value)):
            table.add_row(label, text)
    return table


def recorded_words(recording: Mapping[str, Any] | None) -> tuple[str, str]:
    """Return what became of the recording, and the command that makes a page of it; "" where there is none."""
    if recording is None:
        return "it is not known whether the drive was recorded: wallride logs", ""
    file, words = recording["file"], str(recording["words"])
    told = words.removeprefix(NOT_RECORDING).removeprefix(ENDED).removesuffix(TRYING)
    if not file:
        return f"nothing was recorded: {told}", ""
    ended = "" if recording["is_open"] else f"; not to the end: {told}"
    return f"recorded: {file}{ended}", f"wallride report {file}"


def failed_to_record(recording: Mapping[str, Any] | None) -> bool:
    """Tell whether a recording was wanted and there is none, or only one of a part of the drive."""
    if recording is None or recording["is_open"]:
        return False
    return str(recording["words"]).startswith(NOT_RECORDING)


def shown(value: object) -> str:
    """Return a value of the summary for people; the JSON file has all digits."""
    match value:
        case None:
            return "-"
        case bool():
            return "yes" if value else "no"
        case float():
            return digits(value)
        case dict():
            return ", ".join(f"{key} {shown(one)}" for key, one in value.items())
        case list():
            return ", ".join(shown(one) for one in value)
    return str(value)


def _in(unit: str) -> Words:
    def words(value: Any) -> str:  # noqa: ANN401 - what JSON can hold
        return f"{shown(value)} {unit}" if value is not None else "-"

    return words


def _latency(value: Mapping[str, float] | None) -> str:
    """Return the delay from scan to motor; the longest of a drive says whether this computer was busy."""
    if not value or value.get("p50") is None:
        return "-"
    p50, p99, longest = (shown(value[name]) for name in ("p50", "p99", "max"))
    return f"{p50} ms in half of the scans, {p99} ms in 99 %, longest {longest} ms"


def _winners(value: Mapping[str, float] | None) -> str:
    """Return for how long each source decided; the file's "nobody" is the time before the first decision."""
    if not value:
        return "-"
    return ", ".join(
        f"{'no source' if name == NO_WINNER else name} {shown(spent_s)} s" for name, spent_s in value.items()
    )


def _faults(value: Mapping[str, int] | None) -> str:
    if not value:
        return ""
    kinds = {name: count for name, count in value.items() if " " not in name or name.startswith("motor: ")}
    return ", ".join(count_words(name, count) for name, count in kinds.items())


ROWS: Mapping[str, tuple[str, Words]] = {
    "method": ("law", shown),
    "side": ("followed wall", shown),
    "duration_s": ("drove for", _in("s")),
    "distance_m": ("distance driven", _in("m")),
    "mean_abs_error_m": ("mean distance error", _in("m")),
    "rms_error_m": ("RMS distance error", _in("m")),
    "raced_s": ("along the race line for", _in("s")),
    "kept_by": ("kept from it", "; ".join),
    "line_rms_m": ("last lap off the line, RMS", _in("m")),
    "line_largest_m": ("last lap off the line, at most", _in("m")),
    "trajectory_rms_m": ("found poses off the truth, RMS", _in("m")),
    "trajectory_largest_m": ("found poses off the truth, at most", _in("m")),
    "settle_s": (
        f"within {100 * SETTLE_BAND_M:g} cm after",
        lambda value: (
            _in("s")(value) if value else f"never for {SETTLED_FOR_S:g} s" if value is None else ""
        ),  # 0: it began there
    ),
    "max_overshoot_m": ("largest overshoot", _in("m")),
    "min_clearance_m": ("nearest to the outline", _in("m")),
    "stopped": ("stands at the end", shown),
    "standing_s": ("stood in all", _in("s")),
    "mean_speed_mps": ("mean speed while moving", _in("m/s")),
    "stands_because": ("it stands because", shown),
    "scan_to_motor_ms": ("scan to motor", _latency),
    "telemetry": ("telemetry", lambda value: "" if value == HEARD else shown(value)),
    "scans_sent": ("scans sent by the lidar", shown),
    "scans_driven": ("scans answered", shown),
    "winners": ("who decided", _winners),
    "speed_bounds": ("bound of the speed", "; ".join),
    "hard_stops": ("hard stops", lambda value: times(value) if value else ""),
    "faults": ("device faults", _faults),
    "held_up": ("this computer", str),
    "collided": ("touched something", shown),
    "contacts": ("contacts", lambda value: shown(value) if value else ""),
    "lap_times_s": ("lap times", _in("s")),
    "conditions": ("conditions", shown),
    "changed_while_driving": ("changed while it drove", lambda value: times(value) if value else ""),
    "runtime_distance_error": (
        "the car's own error",
        lambda value: value and f"mean {_in('m')(value['mean_abs_m'])}, RMS {_in('m')(value['rms_m'])}",
    ),
    "recorded_navigation": ("beside the recorded drive", shown),
}
"""By the summary's field: its label, and the function that makes words of its value, "" for none."""
