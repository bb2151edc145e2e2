"""Shape shared by the tables of several experiments: one per law and friction, a column per speed."""

from collections.abc import Callable, Iterator, Sequence

from wallride.sim.lab.cell import TabledCell
from wallride.sim.lab.figures import Row, chosen, distinct

Lines = Sequence[tuple[tuple[str, ...], Sequence[Row]]]
"""For each line of a table its first texts, and the rows of figures behind it."""


def by_law(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Yield each law with its rows, in order of appearance."""
    for law in distinct(rows, "law"):
        yield law, chosen(rows, law=law)


def by_law_and_friction(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Yield the title ("ball+swept, mu 0.8") and the rows of each law and friction, the lowest friction first."""
    for law, of_law in by_law(rows):
        for mu in sorted(distinct(of_law, "mu")):
            yield f"{law}, mu {mu:g}", chosen(of_law, mu=mu)


def speed_table(
    title: str,
    names: tuple[str, ...],
    lines: Lines,
    figure: Callable[[Sequence[Row]], str],
    notes: tuple[str, ...] = (),
) -> TabledCell:
    """Return a table with a row per line and a column per speed; `names` are the titles of the columns before them."""
    speeds = sorted({row["speed_mps"] for _, some in lines for row in some})
    body = tuple((*first, *(figure(chosen(some, speed_mps=speed)) for speed in speeds)) for first, some in lines)
    return TabledCell(title, (*names, *(f"{speed:g} m/s" for speed in speeds)), body, notes)
