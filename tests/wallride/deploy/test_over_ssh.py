"""`wallride deploy` over a real ssh server onto a root of its own: first time, update, failure, rollback, errors."""

import fcntl
import os
import platform
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.wallride.deploy.small_car import SmallCar, make_clone, make_wheel, wheel_of_pip
from wallride import cli
from wallride.deploy import ssh, transfer

pytestmark = pytest.mark.timeout(180)


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """This computer's cache, with all that the small program needs: nothing is downloaded."""
    cache = tmp_path_factory.mktemp("cache")
    folder = cache / "wallride/wheels"
    folder.mkdir(parents=True)
    make_wheel(folder, "small_tool", {"small_tool.py": "answer = 42\n"})
    wheel_of_pip(folder)
    return cache


@pytest.fixture
def clone(tmp_path, wheels, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(wheels))
    return make_clone(tmp_path / "clone")


@pytest.fixture
def car(tmp_path):
    car = SmallCar(tmp_path)
    yield car
    car.stop()


def deploy(car, clone, *options):
    return cli.main(["deploy", "car", "--ssh-config", str(car.config), "--source", str(clone), *options])


def test_a_dry_run_says_what_would_be_done_and_does_nothing(car, clone, capsys):
    assert deploy(car, clone, "--dry-run") == 0
    said = capsys.readouterr().out
    assert "in use there: nothing yet" in said
    assert "nothing done (--dry-run)" in said
    assert list(car.root.iterdir()) == []


def test_a_car_that_hangs_is_given_up(car, clone, capfd, monkeypatch):
    monkeypatch.setattr(ssh, "SILENT_S", 0.3)
    car.tool("uname", f"#!/bin/sh\nexec {sys.executable} -c 'import time; time.sleep(20)'\n")
    assert deploy(car, clone, "--dry-run") == 2
    assert "looking at it: no answer within 0 s; nothing was changed there" in capfd.readouterr().err


def test_a_car_that_talks_for_ever_is_given_up_and_its_words_stay_words(car, clone, capfd):
    car.tool("python3.14", "#!/bin/sh\nexec yes\n")
    assert deploy(car, clone, "--dry-run") == 2
    assert "its answer has no end" in capfd.readouterr().err
    car.tool("python3.14", "#!/bin/sh\nprintf 'missing=odd\\033[2J\\n'\n")
    assert deploy(car, clone, "--dry-run") == 2
    assert r"odd\x1b[2J" in capfd.readouterr().err


def test_first_time_update_rollback_and_what_stays(car, clone, capfd):
    assert deploy(car, clone) == 0
    first = car.in_use()
    assert (car.program(), car.starts()) == ("1.0", (1, "active"))
    assert "2 of the other wheels" in capfd.readouterr().out
    settings, recording = car.root / "etc/wallride/car.toml", car.root / "var/lib/wallride/recordings/drive.mcap"
    settings.write_text("mine")
    recording.parent.mkdir(parents=True)
    recording.write_text("a drive")

    assert deploy(car, make_clone(clone, "2.0")) == 0
    said = capfd.readouterr().out
    assert "0 of the other wheels" in said, "what the car has is not sent again"
    assert "the car says disarmed,ready,ready" in said
    assert (car.program(), car.starts(), len(car.versions())) == ("2.0", (2, "active"), 2)

    assert deploy(car, clone, "--rollback") == 0
    assert (car.in_use(), car.program(), car.starts()) == (first, "1.0", (3, "active"))
    assert (car.root / "etc/systemd/system/wallride.service").read_text() == "unit 1.0"
    assert (settings.read_text(), recording.read_text()) == ("mine", "a drive")


def test_a_python_that_comes_along(car, clone, tmp_path, capfd):
    packed = tmp_path / "packed/python/bin/python3"
    packed.parent.mkdir(parents=True)
    packed.write_text(f'#!/bin/sh\nexec {os.path.realpath(sys.executable)} "$@"\n')
    packed.chmod(0o755)
    stem = f"cpython-{platform.python_version()}+20260101-{platform.machine()}-unknown-linux-gnu-install_only"
    file = tmp_path / f"{stem}.tar.gz"
    subprocess.run(["tar", "-czf", file, "-C", tmp_path / "packed", "python"], check=True)
    assert deploy(car, clone, "--python", str(file)) == 0, capfd.readouterr()
    assert "which comes along" in capfd.readouterr().out
    assert (car.root / "opt/wallride-versions/python" / stem / "bin/python3").read_text() == packed.read_text()
    assert (car.program(), car.starts()) == ("1.0", (1, "active"))


@pytest.mark.parametrize(
    ("planted", "said"),
    [
        ({"run": "sys.exit(1)"}, "it did not start"),
        ({"motor": "lost"}, "before it said disarmed,ready,ready (state, lidar, motor), now disarmed,ready,lost"),
    ],
)
def test_a_version_that_is_not_ready_is_taken_back(planted, said, car, clone, capfd):
    assert deploy(car, clone) == 0
    before = car.in_use()
    assert deploy(car, make_clone(clone, "2.0", **planted)) == 3
    assert said in capfd.readouterr().out
    assert (car.in_use(), car.program(), car.versions()) == (before, "1.0", [before.name])
    assert car.starts() == (3, "active")
    assert not (car.root / "opt/wallride-versions/before").is_symlink()
    assert (car.root / "etc/systemd/system/wallride.service").read_text() == "unit 1.0"


def test_a_car_that_is_armed_is_left_alone(car, clone, capfd):
    assert deploy(car, clone) == 0
    car.tell("armed")
    assert deploy(car, make_clone(clone, "2.0")) == 2
    assert "the car is armed" in capfd.readouterr().err
    assert (car.program(), car.starts()) == ("1.0", (1, "active"))
    assert deploy(car, clone, "--force") == 0
    assert (car.program(), car.starts()) == ("2.0", (2, "active"))


def test_what_is_cut_off_while_it_is_copied_is_never_used(car, clone, monkeypatch):
    def cut_off(entry):
        if entry.name == "install.sh":
            raise KeyboardInterrupt
        return entry

    monkeypatch.setattr(transfer, "_nameless", cut_off)
    assert deploy(car, clone) == 130
    assert not (car.root / "opt").exists()


def test_a_copy_with_a_wrong_byte_is_not_used(car, clone, capfd, monkeypatch):
    monkeypatch.setattr(transfer, "checksum", lambda path: "0" * 64)
    assert deploy(car, clone) == 2
    assert "the copy is damaged or incomplete" in capfd.readouterr().err
    assert car.in_use() is None


def test_two_at_once_are_one_after_the_other(car, clone, capfd):
    lock = car.root / "opt/wallride-versions/lock"
    lock.parent.mkdir(parents=True)
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert deploy(car, clone) == 2
    assert "another installation is going on" in capfd.readouterr().err


def test_a_connection_that_ends_does_not_end_the_installation(car, clone, capfd):
    assert deploy(car, clone) == 0
    hold = Path(f"{car.state}.hold")
    os.mkfifo(hold)

    def cut_off():
        while car.starts()[0] < 2:
            time.sleep(0.02)
        car.stop()  # the service is being restarted
        with hold.open("w"):
            hold.unlink()

    cutter = threading.Thread(target=cut_off)
    cutter.start()
    assert deploy(car, make_clone(clone, "2.0", run="sys.exit(1)")) == 2
    cutter.join()
    assert "the car goes on by itself" in capfd.readouterr().err
    while car.starts() != (3, "active"):
        time.sleep(0.02)
    car.start()
    assert car.program() == "1.0", "not ready, and taken back without the connection"


@pytest.mark.parametrize(
    ("configuration", "said"),
    [
        ({"known_hosts": "empty"}, "its host key is not known"),
        ({"key": "other_key"}, "ssh-copy-id"),
    ],
)
def test_a_login_that_fails_has_a_remedy(configuration, said, car, clone, capfd):
    car.configure(**configuration)
    assert deploy(car, clone) == 2
    assert said in capfd.readouterr().err


def test_a_car_that_is_off_has_a_remedy(car, clone, capfd):
    car.server.terminate()
    car.server.wait(10)
    assert deploy(car, clone) == 2
    assert "no ssh server answers there" in capfd.readouterr().err
    car.start()


@pytest.mark.parametrize(
    ("tool", "script", "said"),
    [
        ("df", "printf 'Filesystem\\nx 100 90 1000 90%% /\\n'", "the car's disk is too full"),
        ("tar", "cat >/dev/null; echo 'tar: x: Cannot write: No space left on device' >&2; exit 2",
         "no space left on its disk"),
    ],
    ids=["said before anything is copied", "it fills up"],
)  # fmt: skip
def test_a_full_disk_changes_nothing(tool, script, said, car, clone, capfd):
    car.tool(tool, f"#!/bin/sh\n{script}\n")
    assert deploy(car, clone) == 2
    assert said in capfd.readouterr().err
    assert car.in_use() is None
    assert not list((car.folder / "home").rglob("*.whl"))
