"""The end of a process that may not be put off: neither by threads that still run in it nor by what they wait for."""

import os
import signal
import threading

MAX_ENDING_S = 2.0
"""Maximum time of the shutdown, below the service's TimeoutStopSec."""


def end_in_time(code: int) -> None:
    """End the process after MAX_ENDING_S, where it has not ended by then: Python itself waits for every thread."""
    try:
        timer = threading.Timer(MAX_ENDING_S, os._exit, (code,))
        timer.daemon = True
        timer.start()
    except (MemoryError, RuntimeError):  # no thread to be had: the kernel's own timer needs no memory
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, MAX_ENDING_S)
