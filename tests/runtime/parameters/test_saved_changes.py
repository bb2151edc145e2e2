"""Saved changes of one or two files: what is written, and what the next start makes of it."""

from tests.runtime.parameters.test_file import KP, ROOT
from wallride.runtime.parameters.file import save
from wallride.runtime.parameters.update import plan
from wallride.runtime.settings.tree import Settings, load_settings


def as_the_desk_edits(settings, **wishes):
    """Return edits and expected values as the desk makes them of a change: everything that became another value."""
    names = {name.replace("__", "."): value for name, value in wishes.items()}
    new = plan(settings, names)
    edits = {name: value for name, _, value in new.changed}
    return edits, {name: value for name, value in edits.items() if value is not None}, new.settings


def test_a_change_of_method_is_one_line(tmp_path):
    file = tmp_path / "car.toml"
    file.write_text("[car]\nname = 'bob'\n")
    edits, expected, settings = as_the_desk_edits(load_settings(file), wall_follow__method="report")
    assert len(edits) > 5, "all that belongs to the other law"
    save(file, edits, expected)
    assert file.read_text() == "[car]\nname = 'bob'\n\n[wall_follow]\nmethod = \"report\"\n"
    assert load_settings(file) == settings


def test_differences_go_into_a_file_of_their_own_and_the_one_below_is_untouched(tmp_path):
    base, own = tmp_path / "sim.toml", tmp_path / "mine" / "sim.toml"
    base.write_text((ROOT / "config" / "sim.toml").read_text())
    before = base.read_text()
    edits, expected, settings = as_the_desk_edits(
        load_settings(base), safety__method="report", wall_follow__kp=10.0, wall_follow__speed_mps=1.5
    )
    save(own, edits, expected, base)
    assert base.read_text() == before
    lines = [line for line in own.read_text().splitlines() if "=" in line]
    assert sorted(lines) == ["kp = 10.0", 'method = "report" # saved while the car ran', "speed_mps = 1.5"]
    assert load_settings(base, saved=own) == settings
    save(own, {KP: 13.5, "wall_follow.speed_mps": 1.0}, {KP: 13.5, "wall_follow.speed_mps": 1.0}, base)
    lines = [line for line in own.read_text().splitlines() if "=" in line]
    assert lines == ['method = "report" # saved while the car ran']


def test_a_value_of_the_file_below_is_saved_when_it_is_the_default_again(tmp_path):
    base, own = tmp_path / "car.toml", tmp_path / "own.toml"
    base.write_text("[wall_follow]\nkp = 9.0\n")
    save(own, {KP: 13.5}, {KP: 13.5}, base)
    assert load_settings(base, saved=own).wall_follow.kp == 13.5


def test_another_law_on_top_leaves_below_what_means_the_same(tmp_path):
    base, own = tmp_path / "car.toml", tmp_path / "own.toml"
    base.write_text("[wall_follow]\nkp = 9.0\nside = 'right'\n")
    own.write_text("[wall_follow]\nmethod = 'report'\n")
    found = load_settings(base, saved=own).wall_follow
    assert (found.method, found.side) == ("report", "right")
    assert found.kp == Settings.model_validate({"wall_follow": {"method": "report"}}).wall_follow.kp
