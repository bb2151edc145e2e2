"""Calibrated values in a settings file: written with their origin, undone, and never half."""

import pytest

from wallride.clients.calibration import settings_file
from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.parameters.file import StoreError
from wallride.runtime.settings.tree import load_settings

FILE = """# the car
[car]
wheelbase_m = 0.25  # from vesc.yaml

[motor]
speed_to_erpm_gain = 4614.0
"""
NEW = [
    Proposal("car.wheelbase_m", 0.25, 0.3312, "0.330 to 0.332"),
    Proposal("lidar.yaw_rad", 0.0, 0.0349, "0.033 to 0.036"),
]


def test_values_are_written_with_their_origin(car_toml):
    settings_file.write(car_toml, NEW, "2026-11-23")
    settings = load_settings(car_toml)
    assert (settings.car.wheelbase_m, settings.lidar.yaw_rad) == (0.3312, 0.0349)
    assert "calibrated 2026-11-23: 0.330 to 0.332; was 0.25" in car_toml.read_text()
    assert "speed_to_erpm_gain = 4614.0\n" in car_toml.read_text()


def test_a_file_by_a_windows_editor_takes_the_values(car_toml):
    car_toml.write_bytes(b"\xef\xbb\xbf" + car_toml.read_bytes())
    settings_file.write(car_toml, NEW, "2026-11-23")
    assert load_settings(car_toml).car.wheelbase_m == 0.3312
    settings_file.undo(car_toml)
    assert load_settings(car_toml).car.wheelbase_m == 0.25


def test_a_link_to_the_file_stays_a_link(car_toml):
    link = car_toml.with_name("link.toml")
    link.symlink_to(car_toml.name)
    settings_file.write(link, NEW, "2026-11-23")
    assert link.is_symlink()
    assert load_settings(car_toml).car.wheelbase_m == 0.3312
    settings_file.undo(link)
    assert link.is_symlink()
    assert load_settings(car_toml).car.wheelbase_m == 0.25


def test_undo_leaves_what_was_edited_since(car_toml):
    settings_file.write(car_toml, NEW, "2026-11-23")
    car_toml.write_text(car_toml.read_text().replace("0.3312", "0.32"))
    lines = settings_file.undo(car_toml)
    assert any("left as it is" in line for line in lines)
    assert load_settings(car_toml).car.wheelbase_m == 0.32


def test_values_with_which_the_car_would_not_start_are_refused(car_toml):
    with pytest.raises(StoreError, match="nothing was saved"):
        settings_file.write(car_toml, [Proposal("car.wheelbase_m", 0.25, 9.0, "")], "2026-11-23")
    assert car_toml.read_text() == FILE
    assert not settings_file.undo_file(car_toml).exists()


def test_a_refused_calibration_leaves_the_way_back_to_before_the_last_one(car_toml):
    settings_file.write(car_toml, NEW, "2026-11-23")
    with pytest.raises(StoreError, match="nothing was saved"):
        settings_file.write(car_toml, [Proposal("car.wheelbase_m", 0.25, 9.0, "")], "2026-11-24")
    settings_file.undo(car_toml)
    assert car_toml.read_text() == FILE
    with pytest.raises(StoreError, match="nothing to undo"):
        settings_file.undo(car_toml)


def test_where_nothing_can_be_put_back_the_way_back_stays(car_toml):
    settings_file.write(car_toml, [Proposal("car.wheelbase_m", 0.25, 0.3, "")], "2026-11-23")
    car_toml.write_text(car_toml.read_text().replace("0.3", "0.32"))
    with pytest.raises(StoreError, match=r"has none of the values of .*; nothing was put back"):
        settings_file.undo(car_toml)
    assert settings_file.undo_file(car_toml).exists()


@pytest.mark.parametrize(
    "text",
    [
        "[lidar]\n[safety.recovery]\ntries = 1\n[car]\nwheelbase_m = 0.25 # mine\n[safety]\nhold_s = 1\n",
        "car.wheelbase_m = 0.25 # mine\nlidar.silent_after_s = 2.0\n",
        "car = { wheelbase_m = 0.25, name = 'a' } # mine\nlidar = { silent_after_s = 2.0 }\n",
        "[safety]\nrecovery.tries = 1\n[safety.window]\nmemory_m = 5\n[car]\nname = 'a'\n[lidar]\n",
    ],
)
def test_a_file_of_any_shape_takes_the_values_and_gives_them_back(tmp_path, text):
    path = tmp_path / "car.toml"
    path.write_text(text)
    before = load_settings(path)
    settings_file.write(path, [*NEW, Proposal("safety.recovery.back_m", 0.6, 0.5, "0.4 to 0.6")], "2026-11-23")
    found = load_settings(path)
    assert (found.car.wheelbase_m, found.lidar.yaw_rad, found.safety.recovery.back_m) == (0.3312, 0.0349, 0.5)
    assert path.read_text().count("calibrated 2026-11-23") == 3
    settings_file.undo(path)
    assert load_settings(path) == before
    assert "calibrated" not in path.read_text()
    assert path.read_text().count("mine") == text.count("mine")
