"""Events of a run: the table of the stops, and the scan at each event."""

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from wallride.runtime.telemetry.screen_words import because, times
from wallride.sim.replay.figures import RecordedStop, newest_change, points, slowed
from wallride.sim.replay.run import MuxChange, RecordedRun
from wallride.sim.run_report.above import Above, from_above
from wallride.sim.world.pose import Floats

MAX_CARDS, MAX_FAULTS = 40, 200
MAX_SCANS = 4
"""Maximum number of scans named of each reason to be slower."""
CARD_PX, CARD_M = 250, 4.0
SAME_EVENT_S = 0.5
NOT_KNOWN = "–"


def stops_table(found: Sequence[RecordedStop], run: RecordedRun, tag: str = "") -> str:
    """Return the time, duration, source and reason of every commanded stop. tag: of the run, beside another."""
    if not found:
        return f"<p>{_without_stops(run)}</p>"
    rows = []
    for number, stop in enumerate(found, 1):
        lasted = f"{stop.until_s - stop.from_s:.2f} s" if math.isfinite(stop.until_s) else "to the end"
        also = f' <span class="also">then: {escape(", ".join(stop.also))}</span>' if stop.also else ""
        rows.append(
            f'<tr><td>{tag}{number}</td><td data-at="{stop.from_s:.3f}">{stop.from_s:.2f} s</td>'
            f"<td>{lasted}</td><td>{escape(stop.winner)}</td>"
            f"<td>{escape(because(stop.reason, stop.measure))}{also}</td>"
            f"<td>{text(stop.speed_mps, 'm/s', 2)}</td></tr>"
        )
    heads = "".join(f"<th>{name}</th>" for name in ("", "at", "for", "by", "why", "from"))
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def slower_table(run: RecordedRun) -> str:
    """Return how often the car was made slower without a stop, the first scans of each reason, what explains one."""
    kinds: dict[tuple[str, str], list[MuxChange]] = {}
    for change in slowed(run):
        kinds.setdefault((change.winner, change.reason), []).append(change)
    if not kinds:
        return ""
    rows = "".join(
        f"<tr><td>{escape(winner)}</td><td>{escape(reason)}</td><td>{times(len(found))}</td>"
        f"<td>{', '.join(_scan(run, change.time_s) for change in found[:MAX_SCANS])}</td></tr>"
        for (winner, reason), found in sorted(kinds.items(), key=lambda kind: -len(kind[1]))
    )
    first = run.scan_at(next(iter(kinds.values()))[0].time_s)
    number = first.sequence if first is not None else 0
    ask = f" <code>wallride replay {escape(run.name)}.mcap --scan {number}</code> tells why at a scan."
    heads = "".join(f"<th>{name}</th>" for name in ("by", "why", "", "first at"))
    return (
        f"<p>Besides, the car was made slower {times(len(slowed(run)))} without a stop.{ask if number else ''}</p>"
        f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"
    )


def _scan(run: RecordedRun, time_s: float) -> str:
    """Return the scan at a time, by its number where it has one."""
    message = run.scan_at(time_s)
    name = f"scan {message.sequence}, " if message is not None and message.sequence else ""
    return f'<span data-at="{time_s:.3f}">{name}{time_s:.2f} s</span>'


def faults_table(run: RecordedRun, tag: str = "") -> str:
    """Return the time and words of what went wrong: warnings, lost devices, commands without effect."""
    if not run.faults:
        return "<p>Nothing was recorded that went wrong.</p>"
    rows = []
    for number, (time_s, fault) in enumerate(run.faults[:MAX_FAULTS], 1):
        lasted = f", for {fault.lasted_s:.2f} s" if math.isfinite(fault.lasted_s) else ""
        rows.append(
            f'<tr><td>{tag}F{number}</td><td data-at="{time_s:.3f}">{time_s:.2f} s</td>'
            f"<td>{escape(fault.words)}{lasted}</td></tr>"
        )
    more = len(run.faults) - len(rows)
    heads = "".join(f"<th>{name}</th>" for name in ("", "at", "what"))
    rest = f"<p>{more} more are not shown.</p>" if more else ""
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>{rest}"


def reasons_table(run: RecordedRun) -> str:
    """Return how often and how long each reason held, the longest first."""
    spent: dict[tuple[str, str], list[float]] = {}
    ends_s = [change.time_s for change in run.changes[1:]] + [run.duration_s]
    for change, end_s in zip(run.changes, ends_s, strict=False):
        spent.setdefault((change.winner, change.reason), []).append(end_s - change.time_s)
    rows = "".join(
        f"<tr><td>{escape(winner)}</td><td>{escape(reason)}</td><td>{sum(held):.2f} s</td>"
        f"<td>{times(len(held))}</td></tr>"
        for (winner, reason), held in sorted(spent.items(), key=lambda item: -sum(item[1]))[:MAX_FAULTS]
    )
    heads = "".join(f"<th>{name}</th>" for name in ("by", "why", "in all", ""))
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>" if rows else ""


def _without_stops(run: RecordedRun) -> str:
    """Return why a drive has no stop: a stop follows a command to move."""
    last = run.changes[-1] if run.changes else None
    if last is None or np.any(run.sent.value):
        return "The car was never told to stop."
    return f"The car never set off: {escape(last.winner)}, {escape(because(last.reason, last.measure))}."


def cards(run: RecordedRun, found: Sequence[RecordedStop], tag: str = "") -> str:
    """Return a picture of the scan at every stop and other decision, forward up."""
    if not run.scans:
        return '<p class="nothing">no scan was recorded</p>'
    events: list[tuple[float, str, MuxChange | None]] = [
        (stop.from_s, f"stop {tag}{number}", newest_change(run, stop.from_s)) for number, stop in enumerate(found, 1)
    ]
    events += [(change.time_s, "decision", change) for change in _apart(run, found)]
    events.sort(key=lambda event: (event[1] == "decision", event[0]))
    shown = sorted(events[:MAX_CARDS], key=lambda event: event[0])
    more = f"<p>{len(events) - len(shown)} more events are not drawn.</p>" if len(events) > len(shown) else ""
    drawn = "".join(_card(run, *event) for event in shown)
    return f'<div class="cards">{drawn}</div>{more}' if drawn else "<p>Nothing but navigation ever decided.</p>"


def _apart(run: RecordedRun, found: Sequence[RecordedStop]) -> list[MuxChange]:
    """Return the other decisions that deserve a picture: not of navigation, and not another of the same moment."""
    kept: list[MuxChange] = []
    for change in run.changes:
        at_stop = any(abs(change.time_s - stop.from_s) < SAME_EVENT_S for stop in found)
        again = kept and change.winner == kept[-1].winner and change.time_s - kept[-1].time_s < SAME_EVENT_S
        if change.winner != "navigation" and not at_stop and not again:
            kept.append(change)
    return kept


def _card(run: RecordedRun, time_s: float, what: str, change: MuxChange | None) -> str:
    message, car = run.scan_at(time_s), run.settings.car
    if message is None:
        return ""
    x_m, y_m = points(message, car)
    # Seen from behind: forward is up.
    sides = ((car.half_width_m, car.front_m), (car.half_width_m, -car.rear_m))
    outline_m = (*sides, *((-aside_m, along_m) for aside_m, along_m in reversed(sides)))
    nothing: Floats = np.empty(0)
    drawing = from_above(Above(-y_m, x_m, nothing, nothing, (), outline_m), CARD_PX, tallest=CARD_PX, around_m=CARD_M)
    why = f"{change.winner}: {because(change.reason, change.measure)}" if change is not None else "not recorded"
    moment = f'<span data-at="{time_s:.3f}">{time_s:.2f} s</span>'
    return f"<figure>{drawing}<figcaption><b>{escape(what)}</b>, {moment}<br>{escape(why)}</figcaption></figure>"


def text(value: object, unit: str, digits: int = 3) -> str:
    """Return a number with its unit, a dash where there is none."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return NOT_KNOWN
    return f"{value:.{digits}f} {unit}"
