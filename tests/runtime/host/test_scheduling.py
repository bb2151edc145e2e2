"""SCHED_FIFO is for the thread that drives; what strangers can keep busy runs below it."""

import os
import subprocess
import sys

import pytest

from runtime.host.scheduling import keep_for_this_thread

INHERITED = "os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))"
ASKED = 'os.environ["WALLRIDE_REALTIME_PRIORITY"] = "20"'
REFUSED = """
import resource
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if os.getuid() == 0: os.setuid(65534)
os.environ["WALLRIDE_REALTIME_PRIORITY"] = "20"
from runtime.host.scheduling import keep_for_this_thread
print(keep_for_this_thread())
print(os.sched_getscheduler(0) == os.SCHED_OTHER)
"""
PROGRAM = """
from runtime.host.scheduling import keep_for_this_thread
print(keep_for_this_thread())
seen = []
thread = threading.Thread(target=lambda: seen.append(os.sched_getscheduler(threading.get_native_id())))
thread.start(); thread.join()
mine = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
print(mine == os.SCHED_FIFO, seen == [os.SCHED_OTHER])
"""


@pytest.mark.parametrize("way", [INHERITED, ASKED])
def test_other_threads_run_below_the_one_that_drives(way):
    done = subprocess.run(
        [sys.executable, "-c", f"import os, threading\n{way}{PROGRAM}"],
        capture_output=True,
        text=True,
        check=False,
        timeout=50,
    )
    if (
        "PermissionError" in done.stderr or "refused" in done.stdout
    ):  # an ordinary user may not ask for SCHED_FIFO: the car drives without
        assert os.getuid() != 0
        return
    words, verdict = done.stdout.splitlines()
    assert words == "real-time scheduling, priority 20, in the thread that drives"
    assert verdict == "True True"


def test_a_refused_policy_is_said_and_the_car_drives_without():
    program = f"import os\nfrom runtime.host import scheduling\n{REFUSED}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=50)
    words, verdict = done.stdout.splitlines()
    assert words.startswith("ordinary scheduling: SCHED_FIFO was refused (Operation not permitted")
    assert verdict == "True"


def test_without_a_real_time_policy_nothing_changes():
    before = os.sched_getscheduler(0)
    assert "scheduling" in keep_for_this_thread()
    assert os.sched_getscheduler(0) == before
