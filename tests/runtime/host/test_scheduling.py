"""SCHED_FIFO is for the thread that drives; what strangers can keep busy runs below it."""

import os
import subprocess
import sys

import pytest

from wallride.runtime.host.scheduling import keep_for_this_thread

INHERITED = "os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))"
ASKED = 'os.environ["WALLRIDE_REALTIME_PRIORITY"] = "20"'
REFUSED = """
import resource
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if os.getuid() == 0: os.setuid(65534)
os.environ["WALLRIDE_REALTIME_PRIORITY"] = "20"
from wallride.runtime.host.scheduling import keep_for_this_thread
print(keep_for_this_thread())
print(os.sched_getscheduler(0) == os.SCHED_OTHER)
"""
NICED = """
import os, threading
real = os.sched_setscheduler
def refuse(thread, policy, parameter):
    if policy & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO:
        raise PermissionError(1, "refused")
    real(thread, policy, parameter)
os.sched_setscheduler = refuse
os.environ["WALLRIDE_REALTIME_PRIORITY"] = "20"
from wallride.runtime.host.scheduling import keep_for_this_thread
print(keep_for_this_thread())
seen = []
thread = threading.Thread(target=lambda: seen.append(os.getpriority(os.PRIO_PROCESS, 0)))
thread.start(); thread.join()
print(os.getpriority(os.PRIO_PROCESS, 0), *seen)
"""
THREADS = """
from wallride.runtime.host.scheduling import ask_for_precedence, keep_for_this_thread
words = keep_for_this_thread()
seen = []
def note():
    policy = os.sched_getscheduler(threading.get_native_id()) & ~os.SCHED_RESET_ON_FORK
    seen.append((policy, os.getpriority(os.PRIO_PROCESS, 0)))
def runs():
    ask_for_precedence()
    note()
    other = threading.Thread(target=note)
    other.start(); other.join()
thread = threading.Thread(target=runs)
thread.start(); thread.join()
print(words)
print(*seen)
"""
PROGRAM = """
from wallride.runtime.host.scheduling import keep_for_this_thread
print(keep_for_this_thread())
seen = []
thread = threading.Thread(target=lambda: seen.append(os.sched_getscheduler(threading.get_native_id())))
thread.start(); thread.join()
mine = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
print(mine == os.SCHED_FIFO, seen == [os.SCHED_OTHER])
"""


def run(program, *, check=True):
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=check, timeout=50)


@pytest.mark.parametrize("way", [INHERITED, ASKED])
def test_other_threads_run_below_the_one_that_drives(way):
    done = run(f"import os, threading\n{way}{PROGRAM}", check=False)
    # an ordinary user may not ask for SCHED_FIFO: the car drives without
    if "PermissionError" in done.stderr or "refused" in done.stdout:
        assert os.getuid() != 0
        return
    words, verdict = done.stdout.splitlines()
    assert words == "real-time scheduling, priority 20, in the thread that drives"
    assert verdict == "True True"


@pytest.mark.parametrize(("way", "policy"), [(ASKED, os.SCHED_FIFO), ("", os.SCHED_OTHER)])
def test_a_thread_of_python_runs_before_ordinary_programs_where_the_one_that_drives_does(way, policy):
    """It may hold the interpreter's lock while another program keeps it from the processor."""
    begun = "os.setpriority(os.PRIO_PROCESS, 0, max(0, os.getpriority(os.PRIO_PROCESS, 0)))"
    words, seen = run(f"import os, threading\n{begun}\n{way}{THREADS}").stdout.splitlines()
    if "refused" in words and os.getuid() != 0:  # an ordinary user may not ask for it without LimitNICE of the unit
        return
    nice = 0 if way else max(0, os.getpriority(os.PRIO_PROCESS, 0))  # SCHED_RESET_ON_FORK takes that of `nice` back
    assert seen == f"({policy}, {nice}) ({os.SCHED_OTHER}, {nice})", "those that it creates stay ordinary"


def test_a_refused_policy_is_said_and_the_car_drives_without():
    done = run(f"import os\nfrom wallride.runtime.host import scheduling\n{REFUSED}", check=False)
    words, verdict = done.stdout.splitlines()
    assert words.startswith("ordinary scheduling: SCHED_FIFO was refused (Operation not permitted")
    assert verdict == "True"


def test_where_a_policy_is_refused_the_thread_that_drives_asks_for_a_niceness():
    words, nice = run(NICED).stdout.splitlines()
    if "niceness" in words:
        assert words.startswith("ordinary scheduling, niceness -10, in the thread that drives: SCHED_FIFO was refused")
        assert nice == "-10 0", "other threads do not inherit it"
    else:  # an ordinary user may not ask for it without LimitNICE of the unit
        assert os.getuid() != 0
        assert words.startswith("ordinary scheduling: SCHED_FIFO was refused")


def test_without_a_real_time_policy_nothing_changes():
    before = os.sched_getscheduler(0)
    assert "scheduling" in keep_for_this_thread()
    assert os.sched_getscheduler(0) == before
