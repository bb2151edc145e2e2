"""Real-time scheduling for the thread that drives, and for no other.

The unit gives the right to ask (LimitRTPRIO) and the wanted priority in the environment, and the process asks: where
the kernel refuses, as with RT_GROUP_SCHED and in containers, systemd's own CPUSchedulingPolicy=fifo would keep the
service from starting, and the car would not drive at all. A policy that the process was started with stays.

A policy is passed on to every thread: zenoh's handshakes with unknown clients and the recorder would then compete with
the motor as equals. With Linux's reset-on-fork flag (sched(7)) threads that are created later get the ordinary policy.

A thread that runs Python may be preempted while it holds the interpreter's lock, and the thread that drives then waits
until the kernel lets that one run again: on a full computer 0.4 s without a motor command. So threads of Python ask for
the lowest real-time priority (`ask_for_precedence`), which no ordinary program interrupts. A niceness was not enough:
it counts among the programs of one session only (sched_autogroup).
"""

import contextlib
import os
from collections.abc import Mapping
from typing import Final

RESET_ON_FORK: int = getattr(os, "SCHED_RESET_ON_FORK", 0)
NICE: Final = -10
"""Niceness where a real-time policy is refused; the unit allows it (LimitNICE). Beside busy clients and processors it
halves the longest time without a motor command."""
PRIORITY_VARIABLE: Final = "WALLRIDE_REALTIME_PRIORITY"


def keep_for_this_thread(environment: Mapping[str, str] = os.environ) -> str:
    """Ask for a real-time policy where the environment does, and keep it for the calling thread only.

    To be called before any other thread is created. Returns a sentence that names the policy in force. Never fails: the
    car drives without a real-time policy too.
    """
    if not hasattr(os, "sched_getscheduler"):
        return "this system has no real-time scheduling"
    policy = os.sched_getscheduler(0) & ~RESET_ON_FORK
    if policy not in {os.SCHED_FIFO, os.SCHED_RR}:
        return _ask(environment.get(PRIORITY_VARIABLE, ""))
    priority = os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, policy | RESET_ON_FORK, priority)
    except OSError as error:
        return f"real-time scheduling in every thread: {error.strerror}"
    return f"real-time scheduling, priority {priority.sched_priority}, in the thread that drives"


def ask_for_precedence() -> None:
    """Ask for the lowest real-time priority beside a thread that drives with one, for NICE beside NICE. Never fails.

    To be called first in every thread that runs Python: it may hold the interpreter's lock. The threads that it creates
    (zenoh's) stay ordinary.
    """
    if not hasattr(os, "sched_getscheduler"):
        return
    driving = os.getpid()  # the id of a process is that of its first thread
    if os.sched_getscheduler(driving) & ~RESET_ON_FORK in {os.SCHED_FIFO, os.SCHED_RR}:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO | RESET_ON_FORK, os.sched_param(1))
    elif os.getpriority(os.PRIO_PROCESS, driving) <= NICE:
        _ask_for_more()


def _ask_for_more() -> str:
    """Ask for a larger share of the processor, for the calling thread only: reset-on-fork resets the niceness, too."""
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
        os.sched_setscheduler(0, os.SCHED_OTHER | RESET_ON_FORK, os.sched_param(0))
    except OSError:
        return "ordinary scheduling"
    return f"ordinary scheduling, niceness {NICE}, in the thread that drives"


def _ask(wanted: str) -> str:
    if not wanted.isdecimal():
        return "ordinary scheduling (systemd/wallride.service asks for SCHED_FIFO)"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | RESET_ON_FORK, os.sched_param(int(wanted)))
    except OSError as error:
        refused = f"SCHED_FIFO was refused ({error.strerror}; a container, or a kernel's RT groups)"
        return f"{_ask_for_more()}: {refused}"
    return f"real-time scheduling, priority {wanted}, in the thread that drives"
