"""The file of what is saved in a simulation."""

from pathlib import Path

from wallride.sim.scenario.simulated_car import find_config, saved_settings


def test_two_files_of_one_name_have_saved_settings_of_their_own(tmp_path):
    home = {"XDG_CONFIG_HOME": str(tmp_path)}
    shipped = saved_settings(find_config(), home)
    assert shipped == tmp_path / "wallride/sim/sim.toml"
    found = {saved_settings(tmp_path / folder / "car.toml", home) for folder in ("a", "b")}
    assert len(found) == 2
    assert all(file.parent == shipped.parent and file.name.startswith("car-") for file in found)
    assert saved_settings(Path("config") / find_config().name, home) == shipped
