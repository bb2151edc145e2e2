"""`install.sh` below another root, with a Python that only pretends: what it says, makes, switches and keeps."""

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from wallride.deploy import wheelhouse
from wallride.deploy.closure import CarPlatform
from wallride.deploy.facts import DeployError

ROOT = Path(__file__).parents[2]
PYTHON = """#!/bin/sh
case "$*" in
    "-c import sys; sys.exit(sys.version_info < (3, 11))") exit ${OLD:-0} ;;
    *"import sys, tomllib"*) exec "$REAL_PYTHON" "$@" ;;
    *"json.load"*) [ -z "${ANSWERS:-}" ] || { head -n 1 "$ANSWERS"; sed -i 1d "$ANSWERS"; } ;;
    "-c "*) exit 0 ;;
    "-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python"
        printf '#!/bin/sh\\necho "%s $*" >>"$CALLS"\\n[ "$1" != build-kernel ] || exit 1\\n' "$3" >"$3/bin/wallride"
        chmod +x "$3/bin/wallride" ;;
    "-m pip "*) echo "pip $* built with ${PIP_CONSTRAINT:-} ${PIP_BUILD_CONSTRAINT:-}" >>"$CALLS"; exit ${BROKEN:-0} ;;
esac
"""

DATE = """#!/bin/sh
n=$(($(cat "$TICKS") + 1))
echo $n >"$TICKS"
echo "20261123-00000$n"
"""


@pytest.fixture
def place(tmp_path):
    """An empty root, a Python, and a clock of its own, which goes on by a second a call."""
    program(tmp_path / "bin/python3", PYTHON)
    program(tmp_path / "bin/date", DATE)
    (tmp_path / "ticks").write_text("0")
    return tmp_path


def program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def install(place, *options, **variables):
    environment = {
        "PATH": f"{place / 'bin'}:{os.environ['PATH']}", "DESTDIR": str(place / "root"),
        "CALLS": str(place / "calls"), "TICKS": str(place / "ticks"), "REAL_PYTHON": sys.executable, **variables,
    }  # fmt: skip
    return subprocess.run(
        ["sh", str(ROOT / "install.sh"), *options], env=environment, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, check=False,
    )  # fmt: skip


def updated(place, times=1):
    for _ in range(times):
        assert install(place, "--yes", "--no-service").returncode == 0


def in_use(place):
    return (place / "root/opt/wallride").readlink().name


def rolled_back(place):
    """Go back; return what is in use then."""
    assert install(place, "--rollback").returncode == 0
    return in_use(place)


def versions(place):
    return sorted(path.name for path in (place / "root/opt/wallride-versions").glob("2*"))


def test_a_dry_run_says_it_and_does_nothing(place):
    done = install(place, "--dry-run")
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["make", "install", "point", "create"]
    assert not (place / "root").exists()


def test_without_consent_nothing_is_done(place):
    done = install(place)
    assert (done.returncode, "say --yes" in done.stderr) == (2, True)
    assert not (place / "root").exists()


def test_it_installs_pinned_versions_and_switches_last(place):
    done = install(place, "--yes")
    assert done.returncode == 0, done.stderr
    calls = (place / "calls").read_text().splitlines()
    assert f"--constraint {ROOT}/constraints.txt {ROOT}[car]" in calls[0]
    assert calls[0].endswith(f"built with {ROOT}/constraints.txt {ROOT}/constraints.txt")
    assert [line.split()[1] for line in calls[1:]] == ["--version", "build-kernel", "completion", "service"]
    assert "--prefix /opt/wallride" in calls[-1]
    assert in_use(place) == "20261123-000001"
    assert (place / "root/usr/local/bin/wallride").readlink() == Path("/opt/wallride/bin/wallride")


def test_an_update_keeps_the_version_before_and_goes_back_to_it(place):
    for _ in range(3):
        assert install(place, "--yes", "--no-service", "--keep", "2").returncode == 0
    assert (in_use(place), versions(place)) == ("20261123-000003", ["20261123-000002", "20261123-000003"])
    for wanted in ("20261123-000002", "20261123-000003"):
        assert rolled_back(place) == wanted


def test_the_newest_versions_stay_and_torsos_go(place):
    updated(place, 5)
    assert versions(place) == ["20261123-000003", "20261123-000004", "20261123-000005"]
    for _ in range(2):  # in use again: the older one, which no later update may remove
        assert install(place, "--rollback").returncode == 0
    (place / "root/opt/wallride-versions/20261123-000003/installed").unlink()
    updated(place)
    assert versions(place) == ["20261123-000004", "20261123-000005", "20261123-000006"]


def test_a_second_installation_at_once_is_refused(place):
    lock = place / "root/opt/wallride-versions/lock"
    lock.parent.mkdir(parents=True)
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        for option in ("--yes", "--rollback"):
            refused = install(place, option)
            assert (refused.returncode, "another installation is going on" in refused.stderr) == (2, True)
    assert versions(place) == []


def test_a_car_that_became_armed_during_the_work_keeps_its_version(place):
    updated(place)
    # It says "disarmed" before the work, and "armed" after it.
    (place / "answers").write_text("disarmed,ready,ready\narmed,ready,ready\n")
    refused = install(place, "--yes", "--no-service", ANSWERS=str(place / "answers"))
    assert (refused.returncode, "the car is armed" in refused.stderr) == (2, True), refused.stderr
    assert (in_use(place), versions(place)) == ("20261123-000001", ["20261123-000001"])


@pytest.mark.parametrize(
    ("settings", "asked_at"),
    [
        ('[telemetry]\nlisten = ["tls/[::]:7448", "tcp/127.0.0.1:7500"]\n', ["--connect", "tcp/127.0.0.1:7500"]),
        ('[telemetry]\nlisten = ["tcp/0.0.0.0:7447"]\n', ["--connect", "tcp/127.0.0.1:7447"]),
        ('[telemetry]\nlisten = ["tcp/[::]:7501"]\n', ["--connect", "tcp/[::1]:7501"]),
        ('[telemetry]\nlisten = ["tls/[::]:7448"]\n', []),
        ("[car]\n", []),
        ("this is no settings file", []),
        (None, []),
    ],
)
def test_the_car_is_asked_where_its_settings_say_that_it_listens(settings, asked_at, place):
    updated(place)
    file = place / "root/etc/wallride/car.toml"
    if settings is not None:
        file.parent.mkdir(parents=True)
        file.write_text(settings)
    (place / "calls").write_text("")
    updated(place)
    asked = [line.split()[1:] for line in (place / "calls").read_text().splitlines() if " status " in line]
    assert asked == [["status", "--json", *asked_at]] * 2, "before the work, and before the switch"


def test_a_step_that_fails_in_the_switch_is_taken_back(place):
    updated(place)
    command = place / "root/usr/local/bin/wallride"
    command.unlink()
    command.mkdir()
    failed = install(place, "--yes", "--no-service")
    assert (failed.returncode, "going back to" in failed.stdout) == (3, True), failed.stderr
    assert (in_use(place), versions(place)) == ("20261123-000001", ["20261123-000001"])


def test_a_failed_update_changes_nothing(place):
    assert install(place, "--yes").returncode == 0
    failed = install(place, "--yes", BROKEN="1")
    assert (failed.returncode, "nothing was changed" in failed.stderr) == (1, True)
    assert (in_use(place), versions(place)) == ("20261123-000001", ["20261123-000001"])


def by_hand(place):
    program(place / "root/opt/wallride/bin/wallride", "#!/bin/sh\n")


def test_an_installation_by_hand_is_kept_as_the_version_before(place):
    by_hand(place)
    assert install(place, "--yes").returncode == 0
    assert in_use(place) == "20261123-000001"
    assert rolled_back(place) == "by-hand"


def test_a_wheelhouse_is_the_only_source(place):
    assert install(place, "--yes", "--wheelhouse", "/wheels").returncode == 0
    assert "--no-index --find-links /wheels" in (place / "calls").read_text()


@pytest.mark.parametrize(
    ("options", "variables", "said"),
    [
        (["--fast"], {}, "--fast is not an option"),
        (["--keep", "1"], {}, "must be 2 to 99"),
        (["--python"], {}, "--python needs a value"),
        (["--yes", "--python", "python3"], {"OLD": "1"}, "is not a Python of 3.11"),
        (["--yes", "--python", "/none.tar.gz"], {}, "/none.tar.gz: is not there"),
        (["--rollback"], {}, "no version before"),
    ],
)
def test_a_mistake_is_one_sentence(options, variables, said, place):
    done = install(place, *options, **variables)
    assert (done.returncode, said in done.stderr) == (2, True), done.stderr


def archive(place, text=PYTHON):
    """An archive with a Python that only pretends."""
    program(place / "packed/python/bin/python3", text)
    file = place / "cpython-3.12.7.tar.gz"
    subprocess.run(["tar", "-czf", file, "-C", place / "packed", "python"], check=True)
    return file


def test_a_python_in_an_archive_is_unpacked_once_and_used(place):
    file = archive(place)
    assert "unpack" in install(place, "--dry-run", "--python", str(file)).stdout
    for _ in range(2):
        done = install(place, "--yes", "--no-service", "--python", str(file))
        assert done.returncode == 0, done.stderr
    unpacked = place / "root/opt/wallride-versions/python/cpython-3.12.7/bin/python3"
    assert unpacked.read_text() == PYTHON
    assert [path.name for path in unpacked.parents[2].iterdir()] == ["cpython-3.12.7"]
    assert len(versions(place)) == 2


@pytest.mark.parametrize("text", ["#!/bin/sh\nexit 1\n", "another machine's\n"])
def test_an_archive_of_no_use_here_changes_nothing(text, place):
    done = install(place, "--yes", "--no-service", "--python", str(archive(place, text)))
    assert (done.returncode, "has no bin/python3 of 3.11 or newer" in done.stderr) == (2, True), done.stderr
    (place / "cpython-3.12.7.tar.gz").write_text("no archive")
    done = install(place, "--yes", "--no-service", "--python", str(place / "cpython-3.12.7.tar.gz"))
    assert (done.returncode, "cannot be unpacked" in done.stderr) == (2, True), done.stderr
    assert not list((place / "root/opt").rglob("cpython*"))
    assert not (place / "root/opt/wallride").exists()


def test_where_no_python_is_new_enough_its_download_is_named(place):
    for name in ("python3.13", "python3.12", "python3.11"):
        (place / "bin" / name).symlink_to("python3")
    done = install(place, "--dry-run", OLD="1")
    assert "download uv" in done.stdout
    assert "python-build-standalone" in done.stdout
    refused = install(place, "--dry-run", "--wheelhouse", "/wheels", OLD="1")
    assert (refused.returncode, "--wheelhouse downloads none" in refused.stderr) == (2, True)


SYSTEMCTL = """#!/bin/sh
case "$*" in
    *ActiveState*) cat "$STATE" ;;
    *MainPID*) echo 7 ;;
    restart*) case $(readlink "$DESTDIR/opt/wallride") in *$BAD) echo failed >"$STATE"; exit 1 ;; esac
        echo active >"$STATE" ;;
esac
"""


def served(place, *options, bad="nothing"):
    """Install with a service that runs, and that does not start with the version `bad`."""
    program(place / "bin/systemctl", SYSTEMCTL)
    program(place / "bin/sleep", "#!/bin/sh\n")
    (place / "state").write_text("active\n")
    variables = {"SYSTEMCTL": str(place / "bin/systemctl"), "STATE": str(place / "state"), "BAD": bad}
    return install(place, *options, "--force", **variables)


@pytest.mark.parametrize("left", ["link", "folder", "file"])
@pytest.mark.parametrize("name", ["opt/wallride.new", "opt/wallride-versions/before.new", "usr/local/bin/wallride.new"])
def test_what_an_installation_that_was_cut_off_left_behind_is_in_no_ones_way(place, name, left):
    updated(place)
    path = place / "root" / name
    if left == "link":
        path.symlink_to("/opt/wallride-versions/gone")
    elif left == "folder":
        path.mkdir()
    else:
        path.write_text("")
    updated(place)
    assert in_use(place) == "20261123-000002"
    assert rolled_back(place) == "20261123-000001"
    assert not os.path.lexists(path)


def test_whatever_roots_umask_is_the_services_user_can_read_the_version(place):
    before = os.umask(0o077)
    try:
        updated(place)
        (place / "root/opt/wallride-versions").chmod(0o700)  # as an older installation left it
        updated(place)
    finally:
        os.umask(before)
    closed = [
        path for path in (place / "root").rglob("*") if not path.is_symlink() and path.stat().st_mode & 0o044 != 0o044
    ]
    assert closed == []


def test_a_rollback_to_a_version_that_is_gone_takes_another_one_or_changes_nothing(place):
    updated(place, 3)
    versions_folder = place / "root/opt/wallride-versions"
    shutil.rmtree(versions_folder / "20261123-000002")
    back = install(place, "--rollback")
    assert (back.returncode, "the version before is gone" in back.stdout) == (0, True)
    assert in_use(place) == "20261123-000001"
    assert (versions_folder / "before").readlink().name == "20261123-000003", "and the way forward is there"
    shutil.rmtree(versions_folder / "20261123-000003")
    refused = install(place, "--rollback")
    assert (refused.returncode, "nothing was changed" in refused.stderr) == (2, True)
    assert in_use(place) == "20261123-000001"


def test_a_rollback_that_does_not_start_brings_the_version_that_ran_back(place):
    updated(place, 2)
    back = served(place, "--rollback", bad="000001")
    assert (back.returncode, "going back to /opt/wallride-versions/20261123-000002" in back.stdout) == (3, True), back
    assert (in_use(place), (place / "state").read_text()) == ("20261123-000002", "active\n")
    assert (place / "root/opt/wallride-versions/before").readlink().name == "20261123-000001"


def test_an_update_that_does_not_start_brings_the_version_that_ran_back(place):
    updated(place)
    failed = served(place, "--yes", "--no-service", bad="000002")
    assert (failed.returncode, in_use(place), versions(place)) == (3, "20261123-000001", ["20261123-000001"])
    assert (place / "state").read_text() == "active\n"


def test_where_the_version_in_use_is_gone_an_installation_makes_a_new_one_and_keeps_the_one_before(place):
    updated(place, 2)
    shutil.rmtree(place / "root/opt/wallride-versions/20261123-000002")
    updated(place)
    assert in_use(place) == "20261123-000003"
    assert rolled_back(place) == "20261123-000001"


def test_where_the_version_in_use_is_gone_a_new_one_that_does_not_start_stays(place):
    """It is all that there is: a way back would be a link to nothing."""
    updated(place)
    shutil.rmtree(place / "root/opt/wallride-versions/20261123-000001")
    failed = served(place, "--yes", "--no-service", bad="000002")
    assert (failed.returncode, "no version before this one to go back to" in failed.stdout) == (3, True), failed
    assert (in_use(place), versions(place)) == ("20261123-000002", ["20261123-000002"])


def test_an_update_cut_off_between_its_links_leaves_a_way_back(place):
    updated(place, 2)
    before = place / "root/opt/wallride-versions/before"
    before.unlink()
    before.symlink_to((place / "root/opt/wallride").readlink())  # "before" is switched first
    assert rolled_back(place) == "20261123-000001"


def test_an_installation_by_hand_that_was_moved_and_not_linked_is_found_again(place):
    by_hand(place)
    (place / "root/opt/wallride-versions").mkdir()
    (place / "root/opt/wallride").rename(place / "root/opt/wallride-versions/by-hand")
    assert install(place, "--yes", "--no-service", BROKEN="1").returncode == 1
    assert in_use(place) == "by-hand"
    updated(place)
    assert rolled_back(place) == "by-hand"


def test_a_wheel_for_a_car_that_cannot_be_built_has_the_reason(tmp_path, monkeypatch):
    (tmp_path / "pyproject.toml").write_text("[project")
    car = CarPlatform("x86_64", (2, 36), (3, 11, 0))
    with pytest.raises(DeployError, match=r"could not be built: .*Expected"):
        wheelhouse.build_wheel(tmp_path, tmp_path, car)
    program(tmp_path / "python3", "#!/bin/sh\necho 'No module named hatchling' >&2\nexit 1\n")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python3"))
    with pytest.raises(DeployError, match="python3 -m pip install hatchling"):
        wheelhouse.build_wheel(tmp_path, tmp_path, car)
