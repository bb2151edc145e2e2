"""Pictures get written, whatever the run was like."""

import numpy as np
import pytest
from PIL import Image

from wallride.sim.figures.comparison import ComparedSteering
from wallride.sim.figures.drawing import save_comparison, save_plot
from wallride.sim.world.worlds import load_world


def shades(path):
    with Image.open(path) as picture:
        return len(picture.convert("RGB").getcolors(1 << 24) or ())


@pytest.mark.parametrize("count", [0, 1, 200])
def test_a_run_of_any_length_is_drawn(tmp_path, count):
    x = np.linspace(-3, 3, count)
    track = np.column_stack([x, np.full(count, 3.0), np.zeros(count)])
    errors = np.where(np.arange(count) % 50 == 7, np.inf, 0.1)
    save_plot(tmp_path / "run.png", load_world("loop"), track, x + 3, errors, "loop")
    assert shades(tmp_path / "run.png") > 10


@pytest.mark.parametrize("count", [0, 50])
def test_a_comparison_is_drawn(tmp_path, count):
    pairs = [ComparedSteering(i * 0.025, 0.1, -0.1) for i in range(count)]
    save_comparison(tmp_path / "pairs.png", pairs, "steering")
    assert shades(tmp_path / "pairs.png") > 5
