"""`wallride` whose wall clock jumps a day ahead at SIGWINCH: python -m tests.system.faults.shifted_clock run ...

Its motor port is a local socket where FAULTS_BUSY is in the environment, as in every row that is measured busy.

The computer's own clock is shared by every process and stays; what jumps is what this process reads of it in Python.
"""

import os
import signal
import sys
import time

from tests.system.socket_motor import use_sockets

DAY_S = 86400


class ShiftedClock:
    """The wall clock, a day ahead for each jump."""

    def __init__(self):
        self._ahead_s = 0
        self._time, self._time_ns = time.time, time.time_ns

    def jump(self, *_):
        """Jump a day ahead."""
        self._ahead_s += DAY_S

    def time(self):
        """Stand in for time.time."""
        return self._time() + self._ahead_s

    def time_ns(self):
        """Stand in for time.time_ns."""
        return self._time_ns() + self._ahead_s * 1_000_000_000


if __name__ == "__main__":
    shifted = ShiftedClock()
    time.time, time.time_ns = shifted.time, shifted.time_ns
    signal.signal(signal.SIGWINCH, shifted.jump)
    if "FAULTS_BUSY" in os.environ:
        use_sockets()
    from wallride.cli import main

    sys.exit(main())
