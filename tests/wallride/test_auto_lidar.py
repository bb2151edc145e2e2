"""`wallride run` with lidar.driver = "auto": it drives with what was found and wrote that down, or says why not."""

import asyncio

import pytest

from wallride.cli import main
from wallride.drivers.api import DriverError
from wallride.drivers.auto.identify import FoundLidar
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.runtime import found_lidar, launch
from wallride.runtime.settings.tree import load_settings

CHOSEN = RplidarSettings(address="serial:///dev/ttyUSB7?baud=115200", yaw_rad=0.2)


FILE = '[lidar]\ndriver = "auto"\nyaw_rad = 0.2\n[telemetry]\nenabled = false\n'


@pytest.fixture
def driven(monkeypatch):
    """Collects what would be driven with: (settings, warnings)."""
    drives = []
    monkeypatch.setattr(launch, "main", lambda settings, _files, _sessions, said, _pad: drives.append((settings, said)))
    return drives


def finds(monkeypatch, found):
    async def look_for(_lidar, _motor):
        await asyncio.sleep(0)
        if isinstance(found, DriverError):
            raise found
        return FoundLidar(found, "RPLIDAR A1M8", found.address)

    monkeypatch.setattr(found_lidar, "look_for", look_for)


def test_the_car_drives_with_what_was_found_and_looks_no_more(car_toml, driven, monkeypatch):
    finds(monkeypatch, CHOSEN)
    assert main(["run", str(car_toml)]) == 0
    settings, said = driven.pop()
    assert settings.lidar == CHOSEN == load_settings(car_toml).lidar
    assert any("RPLIDAR A1M8" in words and str(car_toml) in words for words in said)
    finds(monkeypatch, DriverError("looked for again"))
    assert main(["run", str(car_toml)]) == 0
    assert driven.pop()[0].lidar == CHOSEN


def test_without_a_lidar_it_does_not_start_and_may_be_started_again(car_toml, driven, monkeypatch, capsys):
    before = car_toml.read_text()
    finds(monkeypatch, DriverError("two lidars answer: this and that"))
    assert main(["run", str(car_toml)]) == 1  # with 2 the service manager would give up
    assert 'lidar.driver = "auto": two lidars answer: this and that' in capsys.readouterr().err
    assert not driven
    assert car_toml.read_text() == before


def test_a_simulated_car_has_to_be_told_which_lidar(capsys):
    assert main(["sim", "--headless", "--set", "lidar.driver=auto"]) == 2
    assert "--lidar rplidar" in capsys.readouterr().err
