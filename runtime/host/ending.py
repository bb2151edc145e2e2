"""The end of a process that may not be put off: neither by threads that still run in it nor by what they wait for."""

import os
import threading

MAX_ENDING_S = 2.0
"""Maximum time of the shutdown, below the service's TimeoutStopSec."""


def end_in_time(code: int) -> None:
    """End the process after MAX_ENDING_S, where it has not ended by then: Python itself waits for every thread."""
    timer = threading.Timer(MAX_ENDING_S, os._exit, (code,))
    timer.daemon = True
    timer.start()
