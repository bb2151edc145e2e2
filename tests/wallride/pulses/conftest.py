"""Emulated lidars and boards are opened in virtual time."""

import pytest

from tests import wire_time

pytest_asyncio_loop_factories = wire_time.chosen_for("test_devices.py")


@pytest.fixture
def car_toml(tmp_path):
    """Return the settings file of a car by servo pulses."""
    path = tmp_path / "car.toml"
    path.write_text('[car]\nwheelbase_m = 0.25\n[motor]\ndriver = "pca9685"\n')
    return path
