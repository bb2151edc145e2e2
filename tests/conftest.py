"""Nothing that a test starts may write into the home folder of whoever runs it, or speed up the next one's laws."""

import pytest

from drivers import twin


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
