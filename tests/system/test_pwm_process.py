"""A car with a Maestro or a PCA9685 before the unmodified process, in real time: its scans alone tell the speed."""

import json

import pytest

from wallride.cli import main


@pytest.mark.parametrize("driver", ["maestro", "pca9685"])
def test_it_follows_the_wall_at_one_metre_a_second(tmp_path, driver):
    result = tmp_path / "summary.json"
    options = ["--headless", "--duration", "14", "--json", str(result)]
    driven = ["--set", f"motor.driver={driver}", "--set", "wall_follow.speed_mps=1.0"]
    assert main(["sim", "loop", *options, *driven]) == 0
    summary = json.loads(result.read_text())
    assert not summary["collided"]
    assert summary["distance_m"] > 8.0
    assert summary["mean_abs_error_m"] < 0.10
    assert 0.9 < summary["mean_speed_mps"] < 1.1
