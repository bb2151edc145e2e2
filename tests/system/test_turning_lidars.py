"""Lidars of a full circle before the unmodified process: it drives by their bytes, in real time."""

import json

import pytest

from wallride.cli import main


def drive(tmp_path, *options):
    result = tmp_path / "summary.json"
    assert main(["sim", "loop", "--headless", "--duration", "8", "--json", str(result), *options]) == 0
    return json.loads(result.read_text())


def test_it_follows_the_wall(tmp_path):
    summary = drive(tmp_path, "--lidar", "ydlidar")
    assert not summary["collided"]
    assert not summary["stopped"]
    assert summary["winners"]["navigation"] > 6.0
    assert summary["mean_abs_error_m"] < 0.06


def test_the_lidar_of_the_settings_is_emulated(tmp_path):
    summary = drive(tmp_path, "--set", "lidar.driver=rplidar")
    assert "lidar.settling" in summary["faults"]
    assert summary["distance_m"] > 5.0


@pytest.mark.parametrize("option", [["--recording", "drive.npz"]])
def test_a_recording_goes_with_the_hokuyo_only(tmp_path, option, capsys):
    assert main(["sim", "--lidar", "ydlidar", "--headless", *option]) == 2
    assert "recording" in capsys.readouterr().err
