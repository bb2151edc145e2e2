"""The lidar that was found takes the place of "auto" in the settings file, once, with its origin."""

from datetime import date

import pytest

from wallride.drivers.auto.identify import FoundLidar
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.found_lidar import write_down
from wallride.runtime.lidars import lidar_for
from wallride.runtime.settings.tree import load_settings

TODAY = date(2026, 11, 26)
FILE = """# the car
[lidar]
driver = "auto"   # whatever is plugged in
yaw_rad = 0.1     # measured

[car]
wheelbase_m = 0.31
"""


def found(settings, identity="RPLIDAR A1M8, firmware 1.29"):
    return FoundLidar(settings, identity, settings.address)


@pytest.mark.parametrize(
    "chosen",
    [
        RplidarSettings(address="serial:///dev/ttyUSB0?baud=115200", yaw_rad=0.1),
        YdlidarSettings(address="serial:///dev/ttyUSB0?baud=115200", model="x2", yaw_rad=0.1),
        HokuyoSettings(address="serial:///dev/ttyACM0?baud=115200", yaw_rad=0.1),
        HokuyoSettings(yaw_rad=0.1),
    ],
)
def test_it_is_written_in_place_of_auto(car_toml, chosen):
    assert load_settings(car_toml).lidar.driver == "auto"
    assert f"written into {car_toml}" in write_down(found(chosen), car_toml, None, (), TODAY)
    assert load_settings(car_toml).lidar == chosen
    text = car_toml.read_text()
    assert "found 2026-11-26: RPLIDAR A1M8, firmware 1.29" in text
    assert "yaw_rad = 0.1     # measured" in text
    assert "wheelbase_m = 0.31" in text


def test_what_a_sensor_says_of_itself_stays_in_the_comment(car_toml):
    chosen = RplidarSettings(address="serial:///dev/ttyUSB0")
    write_down(found(chosen, "evil\n[motor]\naddress='x'" + "y" * 900), car_toml, None, (), TODAY)
    settings = load_settings(car_toml)
    assert settings.motor == load_settings(None).motor
    assert max(map(len, car_toml.read_text().splitlines())) < 200


def test_it_is_written_into_the_file_that_says_auto(car_toml, tmp_path):
    chosen = RplidarSettings(address="serial:///dev/ttyUSB0", yaw_rad=0.1)
    saved = tmp_path / "saved.toml"
    saved.write_text("[wall_follow]\nspeed_mps = 0.7\n")
    write_down(found(chosen), car_toml, saved, (), TODAY)
    assert load_settings(car_toml, saved=saved).lidar == chosen
    assert saved.read_text() == "[wall_follow]\nspeed_mps = 0.7\n"

    car_toml.write_text('[lidar]\ndriver = "ydlidar"\n')
    saved.write_text('[lidar]\ndriver = "auto"\nyaw_rad = 0.1\n')
    write_down(found(chosen), car_toml, saved, (), TODAY)
    assert load_settings(car_toml, saved=saved).lidar == chosen
    assert car_toml.read_text() == '[lidar]\ndriver = "ydlidar"\n'


def test_what_cannot_be_written_is_said(car_toml, tmp_path):
    chosen = found(RplidarSettings(address="serial:///dev/ttyUSB0"))
    for file, given in ((car_toml, ("lidar.driver=auto",)), (None, ()), (tmp_path / "gone" / "car.toml", ())):
        words = write_down(chosen, file, None, given, TODAY)
        assert "not written down" in words
        assert "lidar.address = 'serial:///dev/ttyUSB0'" in words
    assert car_toml.read_text() == FILE


def test_auto_itself_is_no_driver():
    with pytest.raises(TypeError, match="names no driver"):
        lidar_for(AutoLidarSettings())
