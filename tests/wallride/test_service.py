"""`wallride service`: says what it will do, does it once, leaves what is the user's, and takes it away again."""

import os
import stat
import subprocess
from pathlib import Path

import pytest

from wallride import cli
from wallride.service import options, parts
from wallride.service.parts import CAR, FOLDER, RULES, UNIT, WANTED

PREFIX = Path("/opt/elsewhere")
AS_ROOT = pytest.mark.skipif(os.geteuid() != 0, reason="accounts and owners are root's")


@pytest.fixture
def root(tmp_path):
    """An image of a system: its accounts and nothing else."""
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
    (tmp_path / "etc/group").write_text("root:x:0:\n")
    (tmp_path / "etc/shadow").write_text("root:*:19000:0:99999:7:::\n")
    (tmp_path / "etc/gshadow").write_text("root:*::\n")
    return tmp_path


def service(root, *arguments):
    return cli.main(["service", *arguments, "--root", str(root), "--prefix", str(PREFIX)])


def tree(root):
    return sorted(str(path.relative_to(root)) for path in root.rglob("*"))


@pytest.mark.parametrize("way", [(), ("--dry-run", "--yes")])
def test_without_consent_it_only_says_what_it_would_do(root, way, capsys):
    before = tree(root)
    assert service(root, "install", *way) == 0
    said = capsys.readouterr().out
    assert "create  system user wallride" in said
    assert f"/{UNIT}" in said
    assert "nothing done" in said
    assert tree(root) == before


@AS_ROOT
def test_installing_twice_is_installing_once(root, capsys):
    assert service(root, "status") == 1
    assert service(root, "install", "--yes") == 0
    assert service(root, "status") == 0
    first = {path: path.lstat().st_mtime_ns for path in root.rglob("*")}
    capsys.readouterr()
    assert service(root, "install", "--yes") == 0
    assert "nothing to do" in capsys.readouterr().out
    assert {path: path.lstat().st_mtime_ns for path in root.rglob("*")} == first
    assert "ExecStart=/opt/elsewhere/bin/wallride run" in (root / UNIT).read_text()
    assert "wallride-vesc" in (root / RULES).read_text()
    assert str((root / WANTED).readlink()) == f"/{UNIT}"
    name, _, user, group, *_ = next(
        line for line in (root / "etc/passwd").read_text().splitlines() if "wallride" in line
    ).split(":")
    assert name == "wallride"
    assert "dialout:x:" in (root / "etc/group").read_text()
    folder = (root / FOLDER).stat()
    assert (folder.st_uid, folder.st_gid, stat.S_IMODE(folder.st_mode)) == (0, int(group), 0o1775)
    assert (root / CAR).stat().st_uid == int(user)


@AS_ROOT
def test_what_root_makes_is_readable_whatever_roots_umask_is_and_the_laws_are_roots(root):
    before = os.umask(0o077)
    try:
        assert service(root, "install", "--yes") == 0
    finally:
        os.umask(before)
    closed = [path for path in (root / "etc").rglob("*") if "shadow" not in path.name and not path.lstat().st_mode & 4]
    assert closed == []
    laws = (root / parts.LAWS).stat()
    assert (laws.st_uid, laws.st_mode & 0o7777) == (0, 0o755)


@AS_ROOT
def test_a_folder_of_laws_that_the_service_made_is_refused(root, capsys):
    (root / parts.LAWS).mkdir(parents=True)
    (root / parts.LAWS).chmod(0o777)
    assert service(root, "status") == 1
    assert service(root, "install", "--yes") == 2
    assert "is not a folder of root's" in capsys.readouterr().err


@AS_ROOT
def test_what_is_the_users_stays_and_an_old_unit_is_renewed(root):
    assert service(root, "install", "--yes") == 0
    (root / CAR).write_text("# mine\n")
    (root / UNIT).write_text("[Service]\n")
    assert service(root, "status") == 1
    assert service(root, "install", "--yes") == 0
    assert (root / CAR).read_text() == "# mine\n"
    assert "Type=notify" in (root / UNIT).read_text()


@AS_ROOT
def test_a_start_at_boot_that_was_disabled_stays_so_until_the_service_was_removed(root, capsys):
    assert service(root, "install", "--yes") == 0
    (root / WANTED).unlink()  # systemctl disable wallride
    (root / UNIT).write_text("[Service]\n")  # an older version's unit
    capsys.readouterr()
    assert service(root, "install", "--yes") == 0
    assert "start at boot: disabled, and stays so" in capsys.readouterr().out
    assert not (root / WANTED).is_symlink()
    assert "Type=notify" in (root / UNIT).read_text()
    assert service(root, "status") == 0, "nothing is missing"
    service(root, "uninstall", "--yes")
    assert service(root, "install", "--yes") == 0
    assert (root / WANTED).is_symlink()


@AS_ROOT
@pytest.mark.parametrize("purge", [False, True])
def test_uninstalling_keeps_settings_and_recordings_unless_told(root, purge, capsys):
    service(root, "install", "--yes")
    (root / "var/lib/wallride").mkdir(parents=True)
    assert service(root, "uninstall", "--yes", *(["--purge"] if purge else [])) == 0
    assert not (root / UNIT).exists()
    assert not (root / RULES).exists()
    assert not (root / WANTED).is_symlink()
    assert (root / CAR).exists() is not purge
    assert (root / "var/lib/wallride").exists() is not purge
    assert parts.has_user(root) is not purge
    assert f"{'remove ' if purge else 'keep   '} /var/lib/wallride" in capsys.readouterr().out
    assert service(root, "uninstall", "--yes") == 0, "a second time nothing is there, and that is well"


def test_a_program_that_the_service_could_not_see_is_refused(root, capsys):
    assert cli.main(["service", "install", "--root", str(root), "--prefix", "/home/ann/venv"]) == 2
    assert "install into /opt/wallride" in capsys.readouterr().err
    assert cli.main(["service", "status", "--root", str(root), "--prefix", "/home/ann/venv"]) == 1
    assert "running /opt/wallride/bin/wallride" in capsys.readouterr().out
    assert service(root, "install", "--yes") == 0
    assert cli.main(["service", "uninstall", "--root", str(root), "--prefix", "/home/ann/venv", "--yes"]) == 0
    assert not (root / UNIT).exists()


def test_an_ordinary_user_is_told_to_use_sudo(root, monkeypatch, capsys):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert service(root, "install", "--yes") == 2
    assert "run it with sudo" in capsys.readouterr().err


def test_a_tool_that_fails_is_quoted(root, monkeypatch, capsys):
    def failing(*_, **__):
        return subprocess.CompletedProcess([], 1, "", "cannot lock /etc/group\n")

    monkeypatch.setattr(subprocess, "run", failing)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert service(root, "install", "--yes") == 2
    assert "groupadd: cannot lock /etc/group" in capsys.readouterr().err


def test_the_unit_has_the_link_that_stays_and_not_the_version_behind_it(tmp_path):
    version, used = tmp_path / "versions/1", tmp_path / "wallride"
    version.mkdir(parents=True)
    used.symlink_to(version)
    assert options._prefix(used, version) == used
    assert options._prefix(tmp_path / "none", version) == version


def test_what_an_account_tool_says_in_two_lines_is_one_sentence(tmp_path, monkeypatch):
    tool = tmp_path / "groupadd"
    tool.write_text("#!/bin/sh\necho 'no such file' >&2\necho 'cannot lock' >&2\nexit 10\n")
    tool.chmod(0o755)
    monkeypatch.setattr("wallride.service.parts.shutil.which", lambda *_, **__: str(tool))
    with pytest.raises(parts.ServiceError, match=r"^groupadd: no such file; cannot lock$"):
        parts._call(tmp_path, "groupadd")


@pytest.mark.parametrize("prefix", ["/opt/my car", "/opt/50%", '/opt/a"b'])
def test_a_prefix_that_systemd_reads_otherwise_is_refused(prefix):
    with pytest.raises(parts.ServiceError, match="choose another folder"):
        parts.visible(Path(prefix), installs=True)
