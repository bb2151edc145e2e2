"""The view from above is judged by its text: what is drawn must stand where it is in the world."""

import io
import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.text import Text

from wallride.sim.live.screen import lap_words
from wallride.sim.live.terminal_view import (
    CAR,
    CAR_OUTSIDE,
    FOLLOW_SPAN_M,
    SCAN,
    WALL,
    ViewStatus,
    page,
    render_world,
    status_rows,
    status_table,
    world_size,
)

NO_WALLS = np.empty((0, 4))
ROOM = np.array([[-5.0, -2.5, 5.0, -2.5], [5.0, -2.5, 5.0, 2.5], [5.0, 2.5, -5.0, 2.5], [-5.0, 2.5, -5.0, -2.5]])
NAN = math.nan


def lines(view: Text) -> list[str]:
    return view.plain.split("\n")


def cells(view: Text, letter: str | None = None) -> list[tuple[int, int]]:
    """(row, column) of each cell with that letter, or of each cell that is not blank."""
    every = [(row, column, found) for row, line in enumerate(lines(view)) for column, found in enumerate(line)]
    return [(row, column) for row, column, found in every if (found == letter if letter else found != " ")]


def styles_at(view: Text, row: int, column: int) -> list[Any]:
    offset = row * (len(lines(view)[0]) + 1) + column
    return [span.style for span in view.spans if span.start <= offset < span.end]


def follow(world: Any, scan: Any = None, car: Any = (0.0, 0.0, 0.0), width: int = 48, height: int = 24) -> Text:
    """A view of 96 x 96 dots over 12 m: a cell is 0.25 m wide and 0.5 m high, the car in cell (12, 24)."""
    return render_world(np.array(world), car, None if scan is None else np.array(scan), width, height, follow=True)


@pytest.mark.parametrize(
    ("wall", "expected"),
    [
        ([2.1, -1.9, 2.1, 1.9], {(row, 32) for row in range(8, 16)}),  # ahead, across
        ([-1.9, 2.3, 1.9, 2.3], {(7, column) for column in range(16, 32)}),  # on the left, along
        ([1.9, 2.3, -1.9, 2.3], {(7, column) for column in range(16, 32)}),  # the same from its other end
        ([-99.0, -2.7, 99.0, -2.7], {(17, column) for column in range(48)}),  # runs out of the view at both ends
        ([99.0, -99.0, 99.0, 99.0], set()),  # beyond the view
        ([3.1, 1.1, 3.1, 1.1], {(9, 36)}),  # a post
    ],
)
def test_a_wall_stands_where_it_is(wall: list[float], expected: set[tuple[int, int]]) -> None:
    view = follow([wall])
    drawn = {(row, column) for row, column in cells(view) if 0x2800 < ord(lines(view)[row][column]) < 0x2900}
    scale = {(23, column) for column in range(48)}
    assert drawn - scale == expected
    assert all(styles_at(view, *cell) == [WALL] for cell in expected)


def test_a_steep_wall_has_no_holes() -> None:
    view = follow([[-1.0, -5.0, 1.0, 5.0]])
    assert {row for row, column in cells(view) if 18 < column < 30} >= set(range(2, 22))


@pytest.mark.parametrize(("column", "row", "letter"), [(0, 0, "⠁"), (1, 0, "⠈"), (0, 2, "⠄"), (0, 3, "⡀"), (1, 3, "⢀")])
def test_each_dot_lights_its_own_bit(column: int, row: int, letter: str) -> None:
    dot_m = 0.125
    point = [[2.0 + (column + 0.5) * dot_m, 2.0 - (row + 0.5) * dot_m]]
    assert cells(follow(np.array(point)), letter) == [(8, 32)]
    assert cells(follow(NO_WALLS, point), letter) == [(8, 32)]


def test_scan_points_are_bright_also_on_a_wall() -> None:
    view = follow([[2.1, -1.9, 2.1, 1.9]], [[2.1, 0.3], [3.1, 3.1]])
    assert styles_at(view, 11, 32) == [SCAN]
    assert styles_at(view, 10, 32) == [WALL]
    assert styles_at(view, 5, 36) == [SCAN]


@pytest.mark.parametrize("point", [[-6.1, 0.1], [6.1, 0.1], [0.1, -6.1], [0.1, 6.1], [-1e300, 1e300]])
def test_a_point_beyond_the_edge_is_not_drawn_on_the_other_side(point: list[float]) -> None:
    assert follow(NO_WALLS, [point]) == follow(NO_WALLS)
    assert follow(np.array([point])) == follow(NO_WALLS)


def test_nan_and_infinity_are_ignored() -> None:
    wall, point = [2.1, -1.9, 2.1, 1.9], [1.1, 1.1]
    broken = [[NAN, 0.0, 1.0, 1.0], [0.0, 0.0, math.inf, 0.0], [-math.inf, 0.0, math.inf, 0.0], wall]
    scan = [[NAN, NAN], [NAN, 0.0], [math.inf, 0.0], point]
    assert follow(broken, scan) == follow([wall], [point])
    assert render_world(np.array(broken), None, np.array(scan), 40, 10, follow=False).plain == (
        render_world(np.array([wall]), None, np.array([point]), 40, 10, follow=False).plain
    )


@pytest.mark.parametrize(
    ("yaw_deg", "arrow"),
    [
        (0, "→"),
        (20, "→"),
        (25, "↗"),
        (90, "↑"),
        (135, "↖"),
        (180, "←"),
        (-180, "←"),
        (-90, "↓"),
        (-45, "↘"),
        (270, "↓"),
    ],
)
def test_the_arrow_points_where_the_car_looks(yaw_deg: float, arrow: str) -> None:
    view = follow(NO_WALLS, car=(7.0, -3.0, math.radians(yaw_deg)))
    assert cells(view, arrow) == [(12, 24)]
    assert styles_at(view, 12, 24) == [CAR]


def test_following_keeps_the_car_in_the_middle_and_moves_the_world() -> None:
    one, other = follow([[2.1, -1.9, 2.1, 1.9]]), follow([[102.1, 48.1, 102.1, 51.9]], car=(100.0, 50.0, 0.0))
    assert one.plain == other.plain


def test_the_whole_room_fits_whatever_the_shape_of_the_terminal() -> None:
    for width, height in [(80, 20), (30, 40), (200, 10)]:
        view = render_world(ROOM, (0.0, 0.0, 0.0), None, width, height, follow=False)
        assert [len(line) for line in lines(view)] == [width] * height
        drawn = [cell for cell in cells(view) if styles_at(view, *cell) == [WALL]]
        columns = [column for _, column in drawn]
        assert abs(min(columns) + max(columns) - (width - 1)) <= 1, "in the middle"
        assert len(set(columns)) > 0.9 * width or len({row for row, _ in drawn}) > 0.8 * height, "as large as possible"


@pytest.mark.parametrize(
    ("car", "cell"),
    [
        ((50.0, 0.0, 0.0), (10, 79)),
        ((-50.0, 0.0, 0.0), (10, 0)),
        ((0.0, 50.0, 0.0), (0, 40)),
        ((50.0, 50.0, 0.0), (0, 79)),
    ],
)
def test_a_car_off_the_map_is_shown_on_the_edge(car: tuple[float, float, float], cell: tuple[int, int]) -> None:
    view = render_world(ROOM, car, None, 80, 20, follow=False)
    assert cells(view, "→") == [cell]
    assert styles_at(view, *cell) == [CAR_OUTSIDE]


@pytest.mark.parametrize("car", [None, (NAN, 0.0, 0.0), (0.0, 0.0, NAN)])
@pytest.mark.parametrize("follows", [True, False])
def test_an_unknown_pose_draws_the_world_without_car(car: Any, follows: bool) -> None:
    view = render_world(ROOM, car, None, 80, 20, follow=follows)
    assert view == render_world(ROOM, None, None, 80, 20, follow=False)
    assert not set(view.plain) & set("→↗↑↖←↙↓↘")


@pytest.mark.parametrize(("width", "height"), [(0, 0), (0, 10), (10, 0), (-3, 5)])
def test_a_terminal_without_room_shows_nothing(width: int, height: int) -> None:
    assert render_world(ROOM, (0.0, 0.0, 0.0), None, width, height, follow=True).plain == ""


@given(width=st.integers(1, 30), height=st.integers(1, 12), follows=st.booleans())
def test_any_size_gives_that_many_full_lines(width: int, height: int, follows: bool) -> None:
    view = render_world(ROOM, (1.0, 1.0, 1.0), ROOM[:, :2], width, height, follow=follows)
    assert [len(line) for line in lines(view)] == [width] * height


def test_an_empty_world_is_no_error() -> None:
    assert cells(render_world(np.empty((0, 2)), (3.0, 4.0, 0.0), None, 40, 10, follow=False), "→") == [(5, 20)]
    assert len(lines(render_world(np.empty((0, 4)), None, np.empty((0, 2)), 40, 10, follow=False))) == 10


@pytest.mark.parametrize(("width", "height", "bar"), [(48, 24, "├──────┤ 2 m"), (60, 24, "├──────────────────┤ 5 m")])
def test_the_bar_is_as_long_as_it_says(width: int, height: int, bar: str) -> None:
    assert lines(follow(NO_WALLS, width=width, height=height))[-1].startswith(f"{bar} ")
    metres_per_cell = FOLLOW_SPAN_M / (height * 4) * 2
    line, length_m, _ = bar.split()
    assert line.count("─") + 2 == float(length_m) / metres_per_cell


STATUS = ViewStatus(12.3456, 1.02, -0.1, None, "SAFETY", "obstacle 0.6 m [ahead]", "ready, 40.0 Hz", "absent: no port")


def printed(what: Any, width: int) -> list[str]:
    console = Console(width=width, file=io.StringIO(), color_system=None, legacy_windows=False)
    console.print(what)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_the_status_says_everything_once() -> None:
    table = [" ".join(line.split()) for line in printed(status_table(status_rows(STATUS)), 60)]
    assert table == [
        "time 12.35 s",
        "speed +1.02 m/s",
        "steering 6° right",
        "distance error -",
        "who decides SAFETY",
        "because obstacle 0.6 m [ahead]",
        "lidar ready, 40.0 Hz",
        "motor absent: no port",
    ]


def test_nobody_decides_and_nothing_is_known() -> None:
    rows = dict(status_rows(ViewStatus(0.0, NAN, None, NAN, "", "", "", "")))
    assert {label: text.strip() for label, text in rows.items()} == {
        "time": "0.00 s",
        "speed": "-",
        "steering": "-",
        "distance error": "-",
        "who decides": "nobody",
        "because": "-",
        "lidar": "-",
        "motor": "-",
    }


@pytest.mark.parametrize(("width", "height"), [(120, 30), (92, 20), (91, 24), (60, 24)])
def test_a_page_fills_the_terminal_and_loses_nothing(width: int, height: int) -> None:
    rows = status_rows(STATUS)
    world_width, world_height = world_size(width, height, rows)
    world = render_world(ROOM, (0.0, 0.0, 0.0), None, world_width, world_height, follow=False)
    shown = printed(page(world, rows, width), width)
    assert len(shown) == height
    assert max(map(len, shown)) <= width
    for line in lines(world):
        assert any(line.rstrip() in seen for seen in shown)
    for label, text in rows:
        assert any(label in seen and text.strip() in seen for seen in shown)


def test_a_tiny_terminal_leaves_no_room_and_no_error() -> None:
    assert world_size(10, 4, status_rows(STATUS)) == (10, 0)
    assert printed(page(render_world(ROOM, None, None, 10, 0, follow=False), status_rows(STATUS), 10), 10)


def test_a_frame_costs_less_than_five_milliseconds() -> None:
    """The fastest of several, because a busy machine only ever adds time."""
    random = np.random.default_rng(1)
    walls = random.uniform(-10, 10, (100, 4))
    scan = random.uniform(-6, 6, (1081, 2))
    costs_s = []
    for _ in range(20):
        start_s = time.perf_counter()
        render_world(walls, (1.0, 2.0, 0.5), scan, 120, 40, follow=True)
        costs_s.append(time.perf_counter() - start_s)
    assert min(costs_s) < 0.005


@pytest.mark.parametrize("width", [48, 55, 60, 80, 100, 120, 200])
def test_what_is_copied_is_never_broken(width):
    address = "http://127.0.0.1:8447/?token=oZl3Lhy-6msw863E"
    rows = [*status_rows(STATUS), ("browser", address)]
    world = render_world(ROOM, None, None, *world_size(width, 40, rows), follow=False)
    shown = printed(page(world, rows, width), width)
    assert any(address in line for line in shown)
    assert len(shown) <= 40


def test_a_race_has_a_row_with_its_laps_and_another_drive_has_none():
    race = {"laps": 2, "time_s": 7.25, "best_s": 7.0, "rms_m": 0.021, "began_s": 100.0}
    said = "lap 3; the last one 7.25 s, the best 7.00 s; 2.1 cm from the line (rms)"
    assert (lap_words(race), lap_words({"laps": 0, "began_s": 9.0}), lap_words({})) == (said, "lap 1", "")
    for began_s in (None, math.nan):
        assert lap_words({"laps": 0, "began_s": began_s}) == "not on the line yet; lap 1 follows"
    assert ("race", said) in status_rows(replace(STATUS, race=said))
    assert "race" not in dict(status_rows(STATUS))
