"""While others want every core, the emulated devices keep their pace: in a car they are other machines."""

import contextlib
import os

import pytest

DEVICES_PRIORITY = 30


@pytest.fixture(autouse=True)
def devices_keep_their_pace():
    """Give this process a real-time policy where `tests.system.faults.measure --busy` asks for it, not the car."""
    if "FAULTS_BUSY" not in os.environ:
        yield
        return
    with contextlib.suppress(OSError):  # refused: measured without
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(DEVICES_PRIORITY))
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
