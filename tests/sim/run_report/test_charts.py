"""Charts are well-formed, keep what matters and stay small."""

from xml.etree import ElementTree as ET

import numpy as np
import pytest

from wallride.sim.run_report.above import Above, from_above
from wallride.sim.run_report.charts import WIDTH, ChartLine, Mark, histogram, over_time

NOTHING = np.empty(0)


def marks_of(text, name):
    return [
        part
        for part in ET.fromstring(text).iter()  # noqa: S314 - our own text
        if part.get("class", "").startswith(name)
    ]


def test_a_line_keeps_its_extremes_however_long_it_is():
    time_s = np.linspace(0, 1800, 72_000)
    value = np.sin(time_s)
    value[40_000] = 5.0
    chart = over_time([ChartLine("", time_s, value)], "m")
    assert len(chart) < 60_000
    (path,) = marks_of(chart, "line")
    heights = [float(number) for number in path.get("d")[1:].replace("L", " ").split()[1::2]]
    assert min(heights) < 35, "the single peak is drawn"
    assert sum(height < 60 for height in heights) <= 3


def test_where_nothing_is_known_no_line_is_drawn():
    value = np.array([0.0, 1.0, np.nan, np.nan, 1.0, 0.0])
    (path,) = marks_of(over_time([ChartLine("", np.arange(6.0), value)], "m"), "line")
    assert path.get("d").count("M") == 2


def test_marks_and_band_are_drawn():
    chart = over_time([ChartLine("", np.arange(3.0), np.zeros(3))], "m", marks=[Mark(1.0, "1")], band=(-0.05, 0.05))
    assert len(marks_of(chart, "mark")) == 2
    (band,) = marks_of(chart, "band")
    assert float(band.get("height")) > 10


def test_two_lines_have_a_legend_and_one_has_none():
    one = ChartLine("sent", np.arange(3.0), np.arange(3.0))
    assert "legend" not in over_time([one], "m/s")
    assert "driven" in over_time([one, ChartLine("driven", np.arange(3.0), np.arange(3.0), "s2")], "m/s")


@pytest.mark.parametrize("value", [NOTHING, np.array([np.nan, np.inf])])
def test_nothing_to_draw_is_said(value):
    assert "not recorded" in histogram(value, "m", 0.01)
    assert "not recorded" in over_time([ChartLine("", np.arange(float(len(value))), value)], "m")


def test_bars_hold_every_value_once():
    values = np.array([-0.051, -0.049, 0.0, 0.001, 0.009, 0.01])
    bars = marks_of(histogram(values, "m", 0.01), "bar")
    heights = [float(bar.get("height")) for bar in bars]
    assert len(bars) == 4
    assert max(heights) == pytest.approx(3 * min(heights), rel=0.02)
    assert len(marks_of(histogram(np.linspace(-30, 30, 5000), "m", 0.01), "bar")) <= 81


def test_a_view_from_above_has_one_scale_for_both_axes():
    track = np.array([0.0, 10.0])
    chart = from_above(Above(NOTHING, NOTHING, track, np.array([0.0, 5.0])), WIDTH, tallest=600)
    (line,) = marks_of(chart, "line")
    x0, y0, x1, y1 = (float(number) for number in line.get("d")[1:].replace("L", " ").split()[:4])
    assert (x1 - x0) / (y0 - y1) == pytest.approx(2.0, rel=0.01)
    assert y0 > y1, "left of the car is up"


def test_a_view_of_very_much_stays_small():
    rng = np.random.default_rng(0)
    chart = from_above(
        Above(rng.uniform(0, 90, 400_000), rng.uniform(0, 60, 400_000), NOTHING, NOTHING), WIDTH, tallest=600
    )
    assert 10_000 < marks_of(chart, "dots")[0].get("d").count("M") <= 30_000
    assert len(chart) < 400_000


def test_a_far_glimpse_does_not_shrink_the_view():
    rng = np.random.default_rng(0)
    x_m, y_m = rng.uniform(-2, 2, 1000), rng.uniform(-2, 2, 1000)
    x_m[:5] = 500.0
    chart = from_above(Above(x_m, y_m, NOTHING, NOTHING), 400, tallest=400)
    dots = marks_of(chart, "dots")[0].get("d")
    assert dots.count("M") > 900
