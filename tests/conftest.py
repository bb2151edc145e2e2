"""What every test has: own folders, laws in Python, a limit that holds; where it runs in real time, a rerun."""

import gc
import os
import signal
from contextlib import suppress
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import HealthCheck
from hypothesis import settings as hypothesis_settings

# How long an example takes is the machine's load, not the code's speed: benchmarks measure that.
hypothesis_settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
hypothesis_settings.load_profile("untimed")

# A shell lets what it starts in the background ignore Ctrl-C, and all that this starts in turn.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

with pytest.MonkeyPatch.context() as at_import:  # in this process only: those that a test starts drive in C
    at_import.setenv("WALLRIDE_COMPILED", "0")
    from tests.clients.monitor.browser import running_chromium, tab  # noqa: F401 - fixtures
    from tests.compiled_laws import put_c_in_place
    from tests.hard_limit import (  # noqa: F401 - hooks
        pytest_configure,
        pytest_runtest_call,
        pytest_runtest_setup,
        pytest_runtest_teardown,
    )
    from tests.own_drivers import driver_file  # noqa: F401 - fixture
    from tests.own_laws import law_file  # noqa: F401 - fixture
    from tests.tiers import (  # noqa: F401 - hooks
        pytest_addoption,
        pytest_ignore_collect,
        pytest_sessionstart,
        without_slow,
    )
    from wallride.drivers import accelerated
    from wallride.runtime.control.own_laws import law_class

REAL_TIME = (
    "clients", "docs", "drivers", "runtime/host", "runtime/recording", "runtime/tasks", "runtime/wire", "sim/bench",
    "sim/devices", "sim/live", "system", "wallride",
)  # fmt: skip
IN_PYTHON = "runtime/control/", "runtime/kernel/"
"""Tests of the laws' Python; tests/runtime/kernel lets the C answer beside it."""
WHOLE_DRIVES = (
    "runtime/control/corridor_following/", "runtime/control/line_following/", "runtime/control/recovery/",
    "runtime/control/safety/", "runtime/control/test_laws.py", "runtime/control/wall_following/",
    "runtime/control/perception/test_own_parts.py", "runtime/control/perception/test_plausibility.py",
    "runtime/control/localization/test_localizer.py", "runtime/control/perception/test_motion_agreement.py",
)  # fmt: skip
"""Among them, those that drive or roll out for long: in C, which tests/runtime/kernel holds to the same answers, and
which gives way to an edited law."""
GIVES_WAY = 10
"""Niceness of a test in virtual time, which may take as long as it takes, beside those in real time."""
MAY_RETURN = os.geteuid() == 0
"""Whether a process may take its niceness back."""
RERUNS = int(os.environ.get("WALLRIDE_RERUNS", "1"))


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Look for no garbage among the tests and modules, which all stay: neither now nor in each later collection."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items, config):
    """Mix files that wait with files that compute, and let tests in real time run again.

    In the order of their names all that starts processes comes last and starves itself. A full machine can stop a test
    with processes, browsers or emulated devices for a second: `make test` names each test that ran again.
    Tests of algorithms run in virtual time, once.
    """
    items[:] = without_slow(items, config)
    items.sort(key=lambda item: crc32(item.nodeid.partition("::")[0].encode()))  # the same in each worker
    here = Path(__file__).parent
    for item in items:
        if item.path.relative_to(here).as_posix().startswith(tuple(f"{folder}/" for folder in REAL_TIME)):
            item.add_marker(pytest.mark.flaky(reruns=RERUNS, reruns_delay=1))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Let a test that only computes give way to those in real time that run beside it."""
    if not MAY_RETURN or item.get_closest_marker("flaky"):
        return (yield)
    before = os.getpriority(os.PRIO_PROCESS, 0)
    os.setpriority(os.PRIO_PROCESS, 0, max(GIVES_WAY, before))
    try:
        return (yield)
    finally:
        for thread in Path("/proc/self/task").iterdir():  # those that it began, and stay, as well
            with suppress(ProcessLookupError):
                os.setpriority(os.PRIO_PROCESS, int(thread.name), before)


@pytest.fixture(scope="session", autouse=True)
def recordings_go_elsewhere(tmp_path_factory):
    """Let every car, also in another process, record into a folder that goes away."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_DATA_HOME", str(tmp_path_factory.mktemp("data")))
        patch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("config")))
        yield


@pytest.fixture(scope="module", autouse=True)
def the_laws_answer_in_c(request):
    """Let the laws answer in C, as they do for a user, but where the Python is what is tested."""
    assert not accelerated.in_c()
    name = request.path.relative_to(Path(__file__).parent).as_posix()
    if name.startswith(IN_PYTHON) and not name.startswith(WHOLE_DRIVES):
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        put_c_in_place(patch)
        yield


@pytest.fixture(autouse=True)
def no_own_law_is_loaded(monkeypatch):
    """A process keeps the laws of the user that it has imported; the fingerprint of the next test's drive has none."""
    monkeypatch.setattr(law_class, "_loaded", {})


@pytest.fixture
def car_toml(tmp_path, request):
    """The settings file of a car, with FILE of the test's module in it."""
    path = tmp_path / "car.toml"
    path.write_text(request.module.FILE)
    return path
