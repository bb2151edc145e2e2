"""Nothing that a test starts may write into the home folder of whoever runs it."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def recordings_go_elsewhere(tmp_path_factory):
    """Let every car, also in another process, record into a folder that goes away."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_DATA_HOME", str(tmp_path_factory.mktemp("data")))
        yield
