"""`wallride race`: positions, gaps and lap times of every car at every endpoint."""

import argparse
import asyncio
import json
import time
from collections.abc import Iterator, Mapping, Sequence

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet.cars import FleetView
from wallride.clients.fleet.lap_timer import StartLine, line_between
from wallride.clients.fleet.links import fleet_links, telling_what_is_awaited, unopened
from wallride.clients.fleet.race import Order, RaceControl, Standing
from wallride.clients.fleet.watching import watch

EVERY_S = 1.0


async def run(options: argparse.Namespace) -> int:
    """Show the race until Ctrl-C, as a table or as a line of JSON a second; options as of `wallride.fleet.options`."""
    race, order = RaceControl(lines_of(options.line or ())), Order(options.order)

    def standings() -> list[Standing]:
        found = race.standings(time.monotonic(), order)
        return [one for one in found if options.car in {None, one.car}]

    async with fleet_links(options) as links:
        view = FleetView(links, race.take)
        if not options.json:
            keys = {ord("n"): ("new race", race.begin)}
            await watch(options, links, lambda: table(standings(), view.silent(time.monotonic())), keys)
        async with telling_what_is_awaited(lambda: unopened(links)):
            while True:
                await asyncio.sleep(EVERY_S)
                options.print_line(json.dumps([one.fields() for one in standings()]))


def lines_of(texts: Sequence[str]) -> Mapping[str, StartLine]:
    """Return the start line of each --line [CAR=]X1,Y1,X2,Y2 by car, "" for all; ConnectionProblemError for another."""
    lines = {}
    for text in texts:
        car, _, numbers = text.rpartition("=")
        try:
            left_x_m, left_y_m, right_x_m, right_y_m = (float(number) for number in numbers.split(","))
            lines[car] = line_between((left_x_m, left_y_m), (right_x_m, right_y_m))
        except ValueError:
            raise ConnectionProblemError(
                f"--line {text}: write the line's left and right end as X1,Y1,X2,Y2 in metres of the car's odometry,"
                " e.g. 0,1,0,-1 or car2=0,1,0,-1"
            ) from None
    return lines


def table(standings: Sequence[Standing], silent: Sequence[str]) -> Iterator[str]:
    """Yield the race's lines. silent: cars that are there and say nothing."""
    yield f"{'':>3} {'car':<16} {'laps':>5} {'last':>9} {'best':>9} {'gap':>10}"
    for one in standings:
        laps = f"{one.laps}{'~' if one.unseen else ''}"
        gap = f"+{one.laps_down} lap{'s' * (one.laps_down > 1)}" if one.laps_down else _seconds(one.gap_s, "+.2f")
        row = f"{one.position:>3} {one.car:<16} {laps:>5} {_seconds(one.last_s)} {_seconds(one.best_s)} {gap:>10}"
        yield f"{row}  {one.note}".rstrip()
    if any(one.unseen for one in standings):
        yield "~ the link was lost at the line: these laps are reckoned from the usual lap time"
    yield from (f"    {car:<16} says nothing" for car in silent)


def _seconds(value_s: float | None, form: str = ".2f") -> str:
    return f"{'-' if value_s is None else format(value_s, form):>9}"
