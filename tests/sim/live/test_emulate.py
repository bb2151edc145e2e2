"""`wallride emulate`: ports that keep their names, and a settings file that stays the user's."""

import asyncio

import pytest

from tests.sim.live.emulated import car, running
from tests.waiting import until
from wallride.cli import main
from wallride.drivers.address import parse_address
from wallride.drivers.api import LinkState, Scan
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.ending import end
from wallride.runtime.lidars import lidar_for, motor_for
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.live.emulate_command import emulated_folder, write_settings
from wallride.sim.live.emulated_car import DeviceAddresses
from wallride.sim.live.session import SessionError


async def test_the_ports_have_names_that_stay_and_go_with_the_car(tmp_path):
    for _ in range(2):
        async with running(car(tmp_path)) as addresses:
            assert addresses.motor == f"serial://{tmp_path}/vesc"
            assert addresses.lidars[1] == f"serial://{tmp_path}/lidar"
            assert all(map(parse_address, (*addresses.lidars, addresses.motor)))
            assert (tmp_path / "vesc").is_char_device()
        assert not (tmp_path / "vesc").exists()


async def test_a_second_emulated_car_on_the_same_port_is_refused(tmp_path):
    async with running(car(tmp_path)) as addresses:
        port = int(addresses.lidar.rpartition(":")[2])
        with pytest.raises(SessionError, match="another emulated car"):
            async with running(car(tmp_path / "other", tcp_port=port)):
                pass


def test_the_settings_are_the_users_and_only_the_addresses_are_renewed(tmp_path):
    file = tmp_path / "car.toml"
    write_settings(file, DeviceAddresses(("tcp://127.0.0.1:1",), "serial:///a"))
    settings = load_settings(file)
    assert (settings.lidar.address, settings.motor.address) == ("tcp://127.0.0.1:1", "serial:///a")
    assert settings.recording.simulated
    assert settings.operator.permit == "required", "as on a car, not as in a simulation"
    file.write_text(file.read_text().replace("wheelbase_m = 0.33 ", "wheelbase_m = 0.25 # mine "))
    write_settings(file, DeviceAddresses(("tcp://127.0.0.1:2",), "serial:///a"))
    assert "0.25 # mine" in file.read_text()
    assert load_settings(file).lidar.address == "tcp://127.0.0.1:2"


def test_the_section_of_another_device_is_written_anew(tmp_path):
    file = tmp_path / "car.toml"
    usual = DeviceAddresses(("tcp://127.0.0.1:1",), "serial:///a")
    other = Settings.model_validate({"lidar": {"driver": "ydlidar", "model": "x2"}, "motor": {"driver": "pca9685"}})
    write_settings(file, usual)
    write_settings(file, DeviceAddresses(("serial:///l",), "/m", "socket"), other)
    settings = load_settings(file)
    assert isinstance(settings.lidar, YdlidarSettings)
    assert isinstance(settings.motor, Pca9685Settings)
    assert (settings.lidar.model, settings.lidar.address, settings.motor.socket) == ("x2", "serial:///l", "/m")
    write_settings(file, usual)
    assert load_settings(file).motor.driver == "vesc"


@pytest.mark.parametrize(("driver", "place"), [("maestro", "serial://{}/maestro"), ("pca9685", "{}/i2c")])
async def test_other_devices_are_reached_by_their_drivers(driver, place, tmp_path):
    settings = Settings.model_validate({"motor": {"driver": driver}})
    one = car(tmp_path, motor=settings.motor, turning="a1")
    async with running(one) as addresses:
        assert addresses.lidars == (f"serial://{tmp_path}/lidar",)
        assert addresses.motor == place.format(tmp_path)
        clock = asyncio.get_running_loop().time
        lidar = lidar_for(RplidarSettings(address=addresses.lidar), clock=clock)
        motor = motor_for(settings.motor.model_copy(update={addresses.motor_key: addresses.motor}), clock=clock)
        scans: list[Scan] = []
        tasks = [asyncio.create_task(lidar.run(scans.append)), asyncio.create_task(motor.run())]
        await until(lambda: scans and motor.health.link is LinkState.READY, 20.0)
        await end(*tasks)


def test_the_folder_is_the_same_at_every_start(tmp_path):
    assert emulated_folder({"XDG_STATE_HOME": str(tmp_path)}) == tmp_path / "wallride" / "emulated"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--vesc-timeout", "0"], "--vesc-timeout 0"),
        (["--vesc-brake", "900"], "--vesc-brake 900"),
        (["--duration", "nan"], "--duration nan"),
        (["nowhere"], "nowhere"),
        (["--set", "lidar.driver=topic", "--set", "ros2.enabled=true"], "lidar.driver = topic"),
    ],
)
def test_a_wrong_option_is_one_sentence(options, said, tmp_path, capsys):
    assert main(["emulate", "--folder", str(tmp_path), *options]) == 2
    assert said in capsys.readouterr().err


def test_a_relative_folder_gives_addresses_that_commands_take(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["emulate", "--folder", "em", "--lidar", "serial", "--duration", "0.05"]) == 0
    settings = load_settings(tmp_path / "em" / "car.toml")
    found = [settings.lidar.address, settings.motor.address]
    assert found == [f"serial://{tmp_path.resolve()}/em/{name}" for name in ("lidar", "vesc")]
    assert all(map(parse_address, found))
