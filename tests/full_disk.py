"""A disk that is full, without one."""

import resource
import signal
from contextlib import contextmanager


@contextmanager
def full_disk(least_b):
    """Let no file of this process grow beyond some bytes while the block runs: writing more fails as on a full disk."""
    before, told = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (least_b, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, told)
