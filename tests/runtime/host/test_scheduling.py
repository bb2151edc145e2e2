"""SCHED_FIFO is for the thread that drives; what strangers can keep busy runs below it."""

import os
import subprocess
import sys

from runtime.host.scheduling import keep_for_this_thread

PROGRAM = """
import os, threading
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
from runtime.host.scheduling import keep_for_this_thread
print(keep_for_this_thread())
seen = []
thread = threading.Thread(target=lambda: seen.append(os.sched_getscheduler(threading.get_native_id())))
thread.start(); thread.join()
mine = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
print(mine == os.SCHED_FIFO, seen == [os.SCHED_OTHER])
"""


def test_other_threads_run_below_the_one_that_drives():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False, timeout=50)
    if "PermissionError" in done.stderr:  # an ordinary user may not ask for SCHED_FIFO: the car drives without
        assert os.getuid() != 0
        return
    words, verdict = done.stdout.splitlines()
    assert words == "real-time scheduling, priority 20, in the thread that drives"
    assert verdict == "True True"


def test_without_a_real_time_policy_nothing_changes():
    before = os.sched_getscheduler(0)
    assert "scheduling" in keep_for_this_thread()
    assert os.sched_getscheduler(0) == before
