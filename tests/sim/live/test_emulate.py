"""`wallride emulate`: ports that keep their names, and a settings file that stays the user's."""

import pytest

from tests.sim.live.emulated import car, running
from wallride.cli import main
from wallride.drivers.address import parse_address
from wallride.runtime.settings.tree import load_settings
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


def test_the_folder_is_the_same_at_every_start(tmp_path):
    assert emulated_folder({"XDG_STATE_HOME": str(tmp_path)}) == tmp_path / "wallride" / "emulated"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--vesc-timeout", "0"], "--vesc-timeout 0"),
        (["--vesc-brake", "900"], "--vesc-brake 900"),
        (["--duration", "nan"], "--duration nan"),
        (["nowhere"], "nowhere"),
    ],
)
def test_a_wrong_option_is_one_sentence(options, said, tmp_path, capsys):
    assert main(["emulate", "--folder", str(tmp_path), *options]) == 2
    assert said in capsys.readouterr().err
