"""What of an own law cannot be loaded, and where its file is looked for."""

import pytest

from tests.own_laws import HEAD, INIT, STRAIGHT
from wallride.runtime.control.method_settings import METHODS, name_of
from wallride.runtime.control.own_laws.law_class import loaded_files
from wallride.runtime.settings.tree import SettingsError, load_settings


def refusal(*assignments):
    with pytest.raises(SettingsError) as caught:
        load_settings(None, assignments, laws=True)
    return str(caught.value)


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("pass", "FILE:3: class Law has no method follow(self, scan, state)"),
        (INIT + "def follow(self, scan): return None", "FILE:3: class Law: follow must take (self, scan, state)"),
        (INIT + "async def follow(self, scan, state): ...", "FILE:3: class Law: follow must be a plain method"),
        ("def follow(self, scan, state): ...", "FILE:3: class Law must be made from (settings, car)"),
        ("Settings = int\n" + STRAIGHT, "FILE:3: class Law: Settings must be a class derived from wallride.laws"),
        (
            "class Settings(LawSettings):\n    gain: float\n" + STRAIGHT,
            "FILE:3: class Law: its setting gain has no def",
        ),
        ("def follow(self, scan, state)", "FILE:4: SyntaxError: expected ':'"),
        ("1 / 0", "FILE:4: ZeroDivisionError: division by zero"),
        ("import nowhere_22", "FILE:4: ModuleNotFoundError: No module named 'nowhere_22'"),
    ],
)
def test_what_cannot_be_loaded_is_said_with_file_and_line(law_file, body, sentence):
    name = law_file(body)
    said = refusal(f"wall_follow.method={name}")
    assert sentence.replace("FILE", name.replace(":Law", ".py")) in said
    assert said.startswith(f"--set: wall_follow.method = '{name}': ")


def test_a_wrong_file_class_or_name_is_said_with_the_remedy(law_file, tmp_path):
    name = law_file(STRAIGHT)
    missing = refusal("wall_follow.method=nowhere_22:Law")
    assert f"there is no nowhere_22.py in {tmp_path}" in missing
    assert "process.laws_folder" in missing
    assert "has no class Lav; did you mean Law?" in refusal(f"wall_follow.method={name[:-1]}v")
    assert "has no class Lost; it has Law" in refusal(f"wall_follow.method={name[:-3]}Lost")
    assert refusal("wall_follow.method=my_laws.py:Law").count("write module:Class, for example my_laws:Follower") == 1
    known = ", ".join(f"'{name_of(law)}'" for law in METHODS["wall_follow"])
    assert f"input should be {known}, 'module:Class'" in refusal("wall_follow.method=bal")
    assert "wall_follow.own.x is not a setting" in refusal(f"wall_follow.method={name}", "wall_follow.own.x=1")


def test_laws_are_found_beside_the_settings_file_and_in_the_folder_named(law_file, tmp_path, monkeypatch):
    name, beside, named = law_file(STRAIGHT), tmp_path / "beside", tmp_path / "named"
    elsewhere = tmp_path / "elsewhere"
    for folder in (beside, named, elsewhere):
        folder.mkdir()
    monkeypatch.chdir(elsewhere)
    other = law_file(STRAIGHT)
    (tmp_path / f"{name[:-4]}.py").rename(beside / f"{name[:-4]}.py")
    (tmp_path / f"{other[:-4]}.py").rename(named / f"{other[:-4]}.py")
    (beside / "car.toml").write_text(f"[wall_follow]\nmethod = '{name}'\n")
    assert load_settings(beside / "car.toml", laws=True).wall_follow.method == name
    wanted = [f"wall_follow.method={other}", f"process.laws_folder={named}"]
    assert load_settings(None, wanted, laws=True).wall_follow.method == other


def test_what_the_settings_of_a_law_raise_is_a_refusal_with_its_line(law_file):
    head = HEAD + "class Own(LawSettings):\n    gain: float = 1.0\n"
    head += "    def model_post_init(self, _):\n        if self.gain == 13: raise SystemExit(0)\n"
    name = law_file(f"Settings = Own\n{STRAIGHT}", head=head)
    assert "SystemExit" in refusal(f"wall_follow.method={name}", "wall_follow.own.gain=13")


def test_the_files_of_a_law_are_its_own_and_those_of_the_users_that_it_imports(law_file, tmp_path):
    (tmp_path / "tools_22").mkdir()
    (tmp_path / "team_22" / "logging").mkdir(parents=True)
    (tmp_path / "logging").mkdir()  # of runs, and no module's
    texts = {
        "gains_22.py": "import math", "tools_22/__init__.py": "from . import fit", "tools_22/fit.py": "import gains_22",
        "team_22/tuning.py": "",
    }  # fmt: skip
    written = [tmp_path / name for name in texts]
    for file in written:
        file.write_text(texts[str(file.relative_to(tmp_path))])
    (tmp_path / "unused_22.py").write_text("")
    late = "def later():\n    import logging\n    from team_22.tuning import G\n    import tools_22\n"
    name = law_file(STRAIGHT, head=HEAD + late)
    load_settings(None, [f"wall_follow.method={name}"], laws=True)
    assert set(loaded_files()) == {*written, tmp_path / f"{name[:-4]}.py"}
