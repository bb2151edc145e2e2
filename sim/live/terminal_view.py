"""Draws the car in its world, seen from above, as text for a terminal. Only rendering: no input, no clock, no output.

Each character is a braille cell of 2 x 4 dots, which are about square on a usual terminal. Walls are dim, scan
points bright, the car is an arrow, a bar gives the scale. North of the map (+y) is up.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from rich.console import Group, RenderableType
from rich.style import Style
from rich.table import Table
from rich.text import Span, Text

from wallride.runtime.arbitration.command import NO_WINNER
from wallride.runtime.telemetry.screen_words import steering_words

Floats = npt.NDArray[np.floating]
Dots = npt.NDArray[np.bool_]

WALL = Style(dim=True)
SCAN = Style(color="bright_green", bold=True)
CAR = Style(color="bright_yellow", bold=True)
CAR_OUTSIDE = Style(color="bright_red", bold=True)
SCALE = Style(color="cyan")
LABEL = Style(dim=True)

ARROWS = "→↗↑↖←↙↓↘"
"""Arrows by eighths of a turn, counter-clockwise from +x."""
BRAILLE_BLANK = 0x2800
DOT_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Unicode's bit of each dot in a cell, by row and column."""
CELL_ROWS, CELL_COLUMNS = 4, 2

FOLLOW_SPAN_M = 12.0
"""Width of the world shown across the shorter side when the view follows the car."""
MARGIN = 1.05
"""Factor by which the whole world is shown smaller than would just fit."""
MIN_SPAN_M = 1.0
NICE_STEPS = (1.0, 2.0, 5.0)
TO_COPY = frozenset({"browser", "port", "terminal"})
"""Labels of rows that have the whole width: a line that is broken is copied wrongly."""
TO_COPY_CHARS = max(map(len, TO_COPY))
STATUS_WIDTH = 46
SEGMENT_COLUMNS = 4


@dataclass(frozen=True, slots=True)
class Viewport:
    """Maps world points to the dots of a terminal: row 0 is the top, column 0 the left."""

    width: int
    height: int
    left_m: float
    top_m: float
    dot_m: float

    @property
    def columns(self) -> int:
        """Return the number of dots across."""
        return self.width * CELL_COLUMNS

    @property
    def rows(self) -> int:
        """Return the number of dots from top to bottom."""
        return self.height * CELL_ROWS

    def draw(self, points_m: Floats) -> Dots:
        """Return the dots, shape (rows, columns), that are hit by world points of shape (n, 2); NaN hits none."""
        dots = np.zeros((self.rows, self.columns), dtype=np.bool_)
        column = (points_m[:, 0] - self.left_m) / self.dot_m
        row = (self.top_m - points_m[:, 1]) / self.dot_m
        # a comparison with NaN is false, so that NaN is outside
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        dots[row[inside].astype(np.intp), column[inside].astype(np.intp)] = True
        return dots


def render_world(
    world: Floats,
    car: tuple[float, float, float] | None,
    scan: Floats | None,
    width: int,
    height: int,
    *,
    follow: bool,
) -> Text:
    """Return the world from above as `height` lines of `width` characters; empty when there is no room.

    world: walls as segments (n, 4) x0, y0, x1, y1 [m], or as points (n, 2) [m], in the world frame; rows that
        are not finite are ignored.
    car: x [m], y [m], yaw [rad] in the world frame; None or NaN draws no car. A car beyond the edge is drawn on
        the edge nearest to it, in another colour.
    scan: points (m, 2) [m] in the world frame; NaN rows are ignored.
    follow: keep the car in the middle, at a fixed scale; otherwise show the whole world.
    """
    if width <= 0 or height <= 0:
        return Text("")
    world = np.asarray(world, dtype=np.float64)
    world = world[np.isfinite(world).all(axis=1)]
    pose = car if car is not None and all(map(math.isfinite, car)) else None
    view = _viewport(world, pose, width, height, follow=follow)
    walls = _cells(view.draw(_sampled(world, view) if world.shape[1] == SEGMENT_COLUMNS else world))
    hits = _cells(view.draw(np.asarray(scan, dtype=np.float64).reshape(-1, 2))) if scan is not None else walls * 0
    canvas = _Canvas.of(walls, hits)
    _put_scale(canvas, view)
    if pose is not None:
        _put_car(canvas, view, pose)
    return canvas.text()


@dataclass(frozen=True, slots=True)
class ViewStatus:
    """Status of the page, as text beside the picture. None or NaN means "not known"."""

    time_s: float
    speed_mps: float | None
    steering_rad: float | None
    distance_error_m: float | None
    winner: str
    reason: str
    lidar: str
    motor: str
    race: str = ""
    page: str = ""
    port: str = ""
    operate: str = ""


def status_rows(status: ViewStatus) -> list[tuple[str, str]]:
    """Return label and text of each line, in the order of importance for a driver."""
    return [
        ("time", f"{status.time_s:8.2f} s"),
        ("speed", _number(status.speed_mps, "+8.2f", "m/s")),
        ("steering", steering_words(status.steering_rad) or "-"),
        ("distance error", _number(status.distance_error_m, "+8.3f", "m")),
        ("who decides", status.winner or NO_WINNER),
        ("because", status.reason or "-"),
        *([("race", status.race)] if status.race else []),
        ("lidar", status.lidar or "-"),
        ("motor", status.motor or "-"),
        *([("browser", status.page)] if status.page else []),
        *([("port", status.port)] if status.port else []),
        *([("terminal", status.operate)] if status.operate else []),
    ]


def status_table(rows: list[tuple[str, str]]) -> Table:
    """Return labels and texts as a table without lines; texts are shown as they are, not as markup."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style=LABEL, no_wrap=True)
    table.add_column(overflow="fold")
    for label, text in rows:
        table.add_row(Text(label), Text(text))
    return table


def world_size(width: int, height: int, rows: Sequence[tuple[str, str]]) -> tuple[int, int]:
    """Return the characters and lines left for the world beside or above these rows of the status.

    A wide terminal has the status on the right and what is to be copied below, a narrow one all of it below; never
    negative.
    """
    below = sum(math.ceil(line.cell_len / max(width, 1)) for line in copied(rows, width))
    if _is_wide(width):
        return max(0, width - STATUS_WIDTH), max(0, height - below)
    return max(0, width), max(0, height - below - sum(label not in TO_COPY for label, _ in rows))


def copied(rows: Sequence[tuple[str, str]], width: int) -> list[Text]:
    """Return what is to be copied, a line each; the label goes where it would break the line."""
    lines = []
    for label, text in rows:
        if label in TO_COPY:
            named = f"{label:<{TO_COPY_CHARS}}  {text}"
            lines.append(Text(named if len(named) <= width else text))
    return lines


def page(world: Text, rows: list[tuple[str, str]], width: int) -> RenderableType:
    """Return the world and the status as one page for a terminal of that width (`world_size` tells the room)."""
    status = status_table([row for row in rows if row[0] not in TO_COPY])
    below = copied(rows, width)
    if not _is_wide(width):
        return Group(world, status, *below)
    side_by_side = Table.grid(padding=0)
    side_by_side.add_column(width=width - STATUS_WIDTH, no_wrap=True)
    side_by_side.add_column(width=STATUS_WIDTH)
    side_by_side.add_row(world, status)
    return Group(side_by_side, *below)


def _is_wide(width: int) -> bool:
    return width >= 2 * STATUS_WIDTH


def _number(value: float | None, form: str, unit: str) -> str:
    return "       -" if value is None or not math.isfinite(value) else f"{value:{form}} {unit}"


def _viewport(
    world: Floats, car: tuple[float, float, float] | None, width: int, height: int, *, follow: bool
) -> Viewport:
    columns, rows = width * CELL_COLUMNS, height * CELL_ROWS
    if follow and car is not None:
        x_m, y_m, dot_m = car[0], car[1], FOLLOW_SPAN_M / min(columns, rows)
    else:
        corners_m = world.reshape(-1, 2)
        if not len(corners_m):
            corners_m = np.array([car[:2] if car is not None else (0.0, 0.0)])
        low_m, high_m = corners_m.min(axis=0), corners_m.max(axis=0)
        x_m, y_m = (low_m + high_m) / 2
        span_m = np.maximum((high_m - low_m) * MARGIN, MIN_SPAN_M)
        dot_m = float(max(span_m[0] / columns, span_m[1] / rows))
    return Viewport(width, height, x_m - columns * dot_m / 2, y_m + rows * dot_m / 2, dot_m)


def _sampled(segments_m: Floats, view: Viewport) -> Floats:
    """Return points on the visible part of each segment, closer together than the dots."""
    start_m, way_m = segments_m[:, :2], segments_m[:, 2:] - segments_m[:, :2]
    enter, leave = _visible_part(start_m, way_m, view)
    seen = enter <= leave
    start_m, way_m, enter, leave = start_m[seen], way_m[seen], enter[seen], leave[seen]
    longest_dots = np.abs(way_m).max(axis=1, initial=0.0) * (leave - enter) / view.dot_m
    counts = np.ceil(longest_dots).astype(np.intp) + 1
    first = np.cumsum(counts) - counts
    steps = np.arange(counts.sum()) - np.repeat(first, counts)
    share = np.repeat(enter, counts) + steps * np.repeat((leave - enter) / np.maximum(counts - 1, 1), counts)
    points_m: Floats = np.repeat(start_m, counts, axis=0) + share[:, None] * np.repeat(way_m, counts, axis=0)
    return points_m


def _visible_part(start_m: Floats, way_m: Floats, view: Viewport) -> tuple[Floats, Floats]:
    """Clip start + share * way to the view (Liang and Barsky); enter > leave where nothing is visible."""
    low_m = np.array([view.left_m, view.top_m - view.rows * view.dot_m])
    high_m = np.array([view.left_m + view.columns * view.dot_m, view.top_m])
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (low_m - start_m) / way_m, (high_m - start_m) / way_m
    # along an axis on which a segment does not move it is inside all the way, or never
    still, inside = way_m == 0, (start_m >= low_m) & (start_m <= high_m)
    near = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(to_low, to_high))
    far = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(to_low, to_high))
    return near.max(axis=1, initial=0.0), far.min(axis=1, initial=1.0)


def _cells(dots: Dots) -> npt.NDArray[np.uint8]:
    """Return the braille bits of each cell, shape (height, width)."""
    height, width = dots.shape[0] // CELL_ROWS, dots.shape[1] // CELL_COLUMNS
    bits = np.zeros((height, width), dtype=np.uint8)
    for row, row_bits in enumerate(DOT_BITS):
        for column, bit in enumerate(row_bits):
            bits |= dots[row::CELL_ROWS, column::CELL_COLUMNS] * np.uint8(bit)
    return bits


STYLES = (Style.null(), WALL, SCAN, CAR, CAR_OUTSIDE, SCALE)
WALL_INDEX, SCAN_INDEX, CAR_INDEX, CAR_OUTSIDE_INDEX, SCALE_INDEX = 1, 2, 3, 4, 5


@dataclass(slots=True)
class _Canvas:
    """Unicode characters and indices into STYLES, both of shape (height, width)."""

    characters: npt.NDArray[np.uint32]
    styles: npt.NDArray[np.int64]

    @classmethod
    def of(cls, walls: npt.NDArray[np.uint8], hits: npt.NDArray[np.uint8]) -> "_Canvas":
        """Join the braille bits of both; a cell with a scan point is bright as a whole."""
        codes = walls | hits
        characters = np.where(codes > 0, codes + np.uint32(BRAILLE_BLANK), np.uint32(ord(" ")))
        return cls(characters, np.where(hits > 0, SCAN_INDEX, np.where(codes > 0, WALL_INDEX, 0)))

    def put(self, row: int, column: int, text: str, style: int) -> None:
        self.characters[row, column : column + len(text)] = [ord(letter) for letter in text]
        self.styles[row, column : column + len(text)] = style

    def text(self) -> Text:
        """Return lines joined by newlines, with one span for each run of equal style."""
        height, width = self.characters.shape
        lines = np.full((height, width + 1), ord("\n"), dtype="<u4")
        lines[:, :width] = self.characters
        plain = lines.tobytes().decode("utf-32-le")[:-1]
        styles = np.zeros((height, width + 1), dtype=np.int64)
        styles[:, :width] = self.styles
        flat = styles.ravel()
        edges = np.flatnonzero(np.diff(flat)) + 1
        starts, ends = [0, *edges.tolist()], [*edges.tolist(), len(plain)]
        spans = [Span(start, end, STYLES[flat[start]]) for start, end in zip(starts, ends, strict=True) if flat[start]]
        return Text(plain, spans=spans, no_wrap=True)


def _put_car(canvas: _Canvas, view: Viewport, car: tuple[float, float, float]) -> None:
    column = math.floor((car[0] - view.left_m) / view.dot_m / CELL_COLUMNS)
    row = math.floor((view.top_m - car[1]) / view.dot_m / CELL_ROWS)
    shown_column, shown_row = min(max(column, 0), view.width - 1), min(max(row, 0), view.height - 1)
    is_inside = (shown_column, shown_row) == (column, row)
    arrow = ARROWS[round(car[2] / (math.pi / 4)) % len(ARROWS)]
    canvas.put(shown_row, shown_column, arrow, CAR_INDEX if is_inside else CAR_OUTSIDE_INDEX)


def _put_scale(canvas: _Canvas, view: Viewport) -> None:
    """Write a bar of a round length into the lower left corner, where there is room for it."""
    cell_m = view.dot_m * CELL_COLUMNS
    longest_m = view.width / 3 * cell_m
    decade_m = 10.0 ** math.floor(math.log10(longest_m))
    length_m = max(step * decade_m for step in NICE_STEPS if step * decade_m <= longest_m)
    cells = round(length_m / cell_m)
    text = f"├{'─' * (cells - 2)}┤ {length_m:g} m"
    if view.height > 2 and cells >= 3 and len(text) <= view.width:
        canvas.put(view.height - 1, 0, text, SCALE_INDEX)
