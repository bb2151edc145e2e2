"""`wallride own-parts` without a car: where the parts are kept is said with the remedy."""

import pytest

from tests.typed import typed
from wallride.clients import own_parts
from wallride.clients.connection import ConnectionProblemError
from wallride.runtime.recording.own_parts_memory import FILE
from wallride.runtime.wire.ports import free_endpoint


@pytest.mark.parametrize("action", ["show", "forget"])
async def test_without_a_car_the_file_is_named(action):
    options = typed("own-parts", action, "--connect", free_endpoint())
    with pytest.raises(ConnectionProblemError, match=rf"cannot connect to .*{FILE} in process\.state_folder") as caught:
        await own_parts.run(options)
    assert "\n" not in str(caught.value)
