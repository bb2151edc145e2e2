"""What every test has: folders of its own, laws in Python; where it runs in real time, two reruns."""

from pathlib import Path

import pytest

from drivers import twin

REAL_TIME = (
    "clients", "docs", "drivers", "runtime/host", "runtime/recording", "runtime/tasks", "runtime/wire", "sim/bench",
    "sim/devices", "sim/live", "system", "wallride",
)  # fmt: skip
RERUNS = 2


def pytest_collection_modifyitems(items):
    """Let tests with processes, browsers and emulated devices run again: a full machine can stop one for a second.

    pytest prints each rerun ("R" and its reason with -ra). Tests of algorithms run in virtual time, once.
    """
    here = Path(__file__).parent
    for item in items:
        if item.path.relative_to(here).as_posix().startswith(tuple(f"{folder}/" for folder in REAL_TIME)):
            item.add_marker(pytest.mark.flaky(reruns=RERUNS, reruns_delay=1))


@pytest.fixture(scope="session", autouse=True)
def recordings_go_elsewhere(tmp_path_factory):
    """Let every car, also in another process, record into a folder that goes away."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_DATA_HOME", str(tmp_path_factory.mktemp("data")))
        patch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("config")))
        yield


@pytest.fixture(autouse=True)
def the_laws_answer_in_python():
    """Let no test inherit the compiled functions from the one before it: the Python is what is tested."""
    yield
    twin.use({})
