"""Where code of the user may come from: a process of root runs none that others may exchange."""

import os
import sys

import pytest

from tests.own_laws import STRAIGHT
from wallride.cli import main
from wallride.doctor.program import laws_open_to_others
from wallride.runtime.host.ownership import changed_by_others
from wallride.runtime.host.user_module import UserCodeError, import_module
from wallride.runtime.settings.tree import SettingsError, load_settings


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Be root, or one who looks like it and to whom this folder belongs."""
    owner = os.geteuid()
    monkeypatch.setattr("wallride.runtime.host.user_module.is_root", lambda: True)
    assert not changed_by_others(tmp_path), f"a folder of {owner} alone"


def planted(folder, mode, name):
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.py").write_text("import builtins; builtins.planted_ran = True\nclass Law: pass\n")
    folder.chmod(mode)
    return f"{name}:Law"


@pytest.mark.parametrize("place", ["working folder", "beside the file", "laws beside it", "laws_folder"])
def test_root_runs_no_code_of_a_place_that_others_write(place, law_file, tmp_path, monkeypatch, root):
    monkeypatch.setattr("builtins.planted_ran", False, raising=False)
    folders = {"working folder": "here", "beside the file": "etc", "laws beside it": "etc/laws", "laws_folder": "named"}
    for folder in folders.values():
        (tmp_path / folder).mkdir(exist_ok=True)
    name = planted(tmp_path / folders[place], 0o777, f"planted_{place.replace(' ', '_')}")
    monkeypatch.chdir(tmp_path / "here")
    file = tmp_path / "etc" / "car.toml"
    file.write_text(f"[wall_follow]\nmethod = '{name}'\n[process]\nlaws_folder = '{tmp_path / 'named'}'\n")
    with pytest.raises(SettingsError, match=r"is not loaded by root, because every user may write .*another user"):
        load_settings(file, laws=True)
    assert not sys.modules["builtins"].planted_ran
    assert str(tmp_path / folders[place]) not in sys.path, "a package that is missing may not come from there, either"


def test_root_runs_a_law_of_a_folder_that_is_roots(law_file, tmp_path, root):
    name = law_file(STRAIGHT)
    assert load_settings(None, [f"wall_follow.method={name}"], laws=True).wall_follow.method == name


def test_a_file_beside_the_law_or_behind_a_link_that_others_write_counts(law_file, tmp_path, root):
    name = law_file(STRAIGHT)
    neighbour = tmp_path / "neighbour.py"
    neighbour.write_text("")
    neighbour.chmod(0o666)
    with pytest.raises(SettingsError, match=r"every user may write .*neighbour\.py"):
        load_settings(None, [f"wall_follow.method={name}"], laws=True)
    elsewhere = tmp_path / "open"
    elsewhere.mkdir()
    neighbour.unlink()
    neighbour.symlink_to(elsewhere / "real.py")
    (elsewhere / "real.py").write_text("")
    elsewhere.chmod(0o777)
    with pytest.raises(SettingsError, match=r"every user may write .*open"):
        load_settings(None, [f"wall_follow.method={name}"], laws=True)


def test_a_module_that_python_finds_by_itself_is_refused_to_root_as_well(tmp_path, monkeypatch, root):
    planted(tmp_path, 0o755, "by_pythonpath")
    (tmp_path / "by_pythonpath.py").chmod(0o666)
    monkeypatch.setattr("sys.path", [*sys.path, str(tmp_path)])
    monkeypatch.chdir("/")
    with pytest.raises(UserCodeError, match=r"by_pythonpath\.py is not loaded by root"):
        import_module("by_pythonpath")


@pytest.mark.parametrize("open_one", ["pkg/sub/drv.py", "pkg/sub", "plain_space", "plain_space/mod.py", "helper.py"])
def test_no_part_of_a_package_and_no_import_of_a_law_is_open_to_others(open_one, tmp_path, monkeypatch, root):
    name = {"pkg": "pkg.sub.drv", "plain_space": "plain_space.mod", "helper.py": "needs_helper"}[open_one.split("/")[0]]
    for file in ("pkg/__init__.py", "pkg/sub/drv.py", "plain_space/mod.py", "helper.py", "needs_helper.py"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text("import builtins; builtins.planted_ran = True\n" if "init" not in file else "")
    (tmp_path / "needs_helper.py").write_text("import helper\n")
    monkeypatch.setattr("builtins.planted_ran", False, raising=False)
    monkeypatch.setattr("sys.path", [*sys.path, str(tmp_path)])
    monkeypatch.chdir("/")
    for loaded in ("pkg", "pkg.sub", "pkg.sub.drv", "plain_space", "plain_space.mod", "helper", "needs_helper"):
        monkeypatch.delitem(sys.modules, loaded, raising=False)
    (tmp_path / open_one).chmod(0o777)
    with pytest.raises(UserCodeError, match=f"{open_one} is not loaded by root|every user may write .*{open_one}"):
        import_module(name)
    assert not sys.modules["builtins"].planted_ran
    (tmp_path / open_one).chmod(0o755)
    import_module(name)


def test_others_are_those_who_may_exchange_a_file_or_a_folder_above_it(tmp_path, monkeypatch):
    file = tmp_path / "a" / "b" / "law.py"
    file.parent.mkdir(parents=True)
    file.write_text("")
    assert changed_by_others(file) == ""
    file.chmod(0o602)
    assert changed_by_others(file) == f"every user may write {file}"
    file.chmod(0o600)
    (tmp_path / "a").chmod(0o777)
    assert changed_by_others(file) == f"every user may write {tmp_path / 'a'}"
    (tmp_path / "a").chmod(0o1777)
    assert changed_by_others(file) == "", "sticky: what is in it cannot be exchanged"
    assert changed_by_others(tmp_path / "a"), "but more can be put into it"
    monkeypatch.setattr(os, "geteuid", lambda: 4242)
    if os.getuid() != 0:
        assert "belongs to user" in changed_by_others(file)
    (tmp_path / "a" / "b").chmod(0o775)
    monkeypatch.setattr(os, "getegid", lambda: 4243)
    if os.getgid() != 0:
        assert "may write" in changed_by_others(tmp_path / "a" / "b")


@pytest.mark.parametrize(
    "command", [["keys", "list", "--dir", "nowhere"], ["vesc", "set", "--dry-run"], ["doctor", "--only", "access"]]
)
def test_a_command_that_needs_no_law_loads_none(command, tmp_path, monkeypatch, capfd, law_file):
    monkeypatch.delitem(sys.modules, "spoken", raising=False)
    (tmp_path / "spoken.py").write_text("print('the law ran')\n")
    file = tmp_path / "car.toml"
    file.write_text("[wall_follow]\nmethod = 'spoken:Law'\n[motor]\naddress = '/dev/none'\n")
    for module in ("keys_options", "vesc.options", "bringup.doctor_options"):
        monkeypatch.setattr(f"wallride.{module}.default_config", lambda: file)
    main(command)
    assert "the law ran" not in "".join(capfd.readouterr())
    assert "spoken" not in sys.modules
    main(["check", str(file)])
    assert "the law ran" in capfd.readouterr().out, "or nothing was tried here"


def test_check_and_doctor_say_that_a_law_may_be_exchanged(law_file, tmp_path, monkeypatch):
    monkeypatch.setattr("wallride.runtime.host.user_module.is_root", lambda: False)
    name = law_file(STRAIGHT)
    load_settings(None, [f"wall_follow.method={name}"], laws=True)
    assert laws_open_to_others() == []
    tmp_path.chmod(0o777)
    ((words, remedy),) = laws_open_to_others()
    assert f"every user may write {tmp_path}" in words
    assert "/etc/wallride/laws" in remedy
