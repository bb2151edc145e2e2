"""Real-time scheduling for the thread that drives, and for no other.

A service started with CPUSchedulingPolicy=fifo passes that policy on to every thread: zenoh's handshakes with unknown
clients and the recorder would then compete with the motor as equals. With Linux's reset-on-fork flag (sched(7)) threads
that are created later get the ordinary policy.
"""

import os

RESET_ON_FORK: int = getattr(os, "SCHED_RESET_ON_FORK", 0)


def keep_for_this_thread() -> str:
    """Keep a real-time policy for the calling thread only; to be called before any other thread is created.

    Returns a sentence that names the policy in force. Never fails: the car drives without a real-time policy too.
    """
    if not hasattr(os, "sched_getscheduler"):
        return "this system has no real-time scheduling"
    policy = os.sched_getscheduler(0) & ~RESET_ON_FORK
    if policy not in {os.SCHED_FIFO, os.SCHED_RR}:
        return "ordinary scheduling (systemd/wallride.service asks for SCHED_FIFO)"
    priority = os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, policy | RESET_ON_FORK, priority)
    except OSError as error:
        return f"real-time scheduling in every thread: {error.strerror}"
    return f"real-time scheduling, priority {priority.sched_priority}, in the thread that drives"
