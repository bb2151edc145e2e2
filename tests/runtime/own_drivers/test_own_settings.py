"""Settings of a driver of the user whose own code raises: one sentence with its line, whatever it raises."""

import pytest

from tests.runtime.own_drivers.test_own_lidar import DRIVER
from wallride.runtime.host.stop_signals import STOP_SIGNALS_HELD
from wallride.runtime.settings.tree import SettingsError, load_settings

RAISES = {
    "validator": """from pydantic import field_validator
class Own(DriverSettings):
    gain: float = 1.0
    @field_validator("gain")
    @classmethod
    def _is_lucky(cls, gain):
        if gain == 13:
            raise {error}
        return gain
""",
    "default": """from pydantic import Field
def boom():
    raise {error}
class Own(DriverSettings):
    gain: float = Field(default_factory=boom)
""",
    "afterwards": """class Own(DriverSettings):
    gain: float = 1.0
    def model_post_init(self, context):
        raise {error}
""",
}


@pytest.fixture(autouse=True)
def _as_in_a_car(monkeypatch):
    monkeypatch.setattr(type(STOP_SIGNALS_HELD), "__bool__", lambda _: True)


@pytest.mark.parametrize("where", RAISES)
@pytest.mark.parametrize("error", ["SystemExit(0)", "ZeroDivisionError()", "TypeError('no')", "BaseException('x')"])
def test_what_its_settings_raise_is_a_refusal_with_its_line(driver_file, where, error):
    driver = DRIVER.format(then="pass").replace("class Driver:", "class Driver:\n    Settings = Own")
    name = driver_file(RAISES[where].format(error=error) + driver)
    with pytest.raises(SettingsError, match=rf"{name.partition(':')[0]}\.py:\d+.*{error.partition('(')[0]}"):
        load_settings(None, [f"lidar.driver={name}", "lidar.own.gain=13"], drivers=True)
