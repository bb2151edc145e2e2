"""Paths of the settings that would write over each other are refused before anything is written."""

import pytest

from wallride.cli import main
from wallride.doctor.places import colliding_places
from wallride.runtime.settings.tree import load_settings

SAME, INSIDE = "are the same", "in which nothing else is written"


@pytest.mark.parametrize(
    ("wanted", "says"),
    [
        ({"parameters.history_file": "car.toml"}, SAME),
        ({"parameters.history_file": "link.toml"}, SAME),
        ({"parameters.history_file": "own-parts.json", "process.state_folder": "."}, SAME),
        ({"parameters.history_file": "drives", "recording.folder": "drives"}, SAME),
        ({"parameters.history_file": "tty", "motor.address": "serial://{here}/tty"}, SAME),
        ({"parameters.history_file": "keys/people.toml", "telemetry.keys_dir": "keys"}, INSIDE),
        ({"parameters.history_file": "laws/mine.py", "process.laws_folder": "laws"}, INSIDE),
        ({"recording.folder": "keys", "telemetry.keys_dir": "keys"}, INSIDE),
        ({"recording.folder": "pads/drives", "joystick.layouts_folder": "pads"}, INSIDE),
        ({"process.state_folder": "uplink", "telemetry.connect_keys_dir": "uplink"}, INSIDE),
        ({"parameters.history_file": "notes.txt"}, "is no history of changes"),
        ({"parameters.history_file": "."}, "is no history of changes"),
        ({"parameters.history_file": "changes.jsonl", "recording.folder": "drives", "process.state_folder": "."}, ""),
        ({"parameters.history_file": "new/changes.jsonl"}, ""),
        ({}, ""),
    ],
)
def test_two_paths_at_one_place_are_refused(wanted, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, text in {"notes.txt": "buy milk\n", "changes.jsonl": '{"stamp_s": 1.0}\n'}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "link.toml").symlink_to("car.toml")
    lines = [f"{name} = '{value.replace('{here}', str(tmp_path))}'" for name, value in wanted.items()]
    (tmp_path / "car.toml").write_text("\n".join(lines))
    before = (tmp_path / "car.toml").read_bytes()
    found = colliding_places(load_settings(tmp_path / "car.toml"), [tmp_path / "car.toml"])
    assert len(found) == (1 if says else 0), found
    assert says in "".join(found)
    assert main(["check", "car.toml"]) == (2 if says else 0)
    assert says in capsys.readouterr().err
    if says:
        assert main(["run", "car.toml"]) == 2
        assert says in capsys.readouterr().err
    assert (tmp_path / "car.toml").read_bytes() == before
