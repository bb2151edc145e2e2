"""Disks that fail on command."""

import errno
import os
import threading
import time

from wallride.runtime.recording.disk import Disk


class QuickDisk(Disk):
    """The machine's own, which may take its time: no test here cuts the power."""

    def sync(self, descriptor):
        """Trust the kernel."""


class BadDisk(QuickDisk):
    """A disk with a fault. failing: what it answers to writes, None while it is well. short: takes bytes in pieces."""

    def __init__(self):
        self.failing = None
        self.failing_creates = None
        self.takes_bytes = None  # before it is full
        self.free = 10**12
        self.short = False
        self.written_bytes = 0

    def create(self, path):
        self._fail(self.failing_creates)
        return super().create(path)

    def write(self, descriptor, data):
        self._fail(self.failing)
        if self.short:
            data = data[:1000]
        if self.takes_bytes is not None:
            if self.takes_bytes <= 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            data = data[: self.takes_bytes]
            self.takes_bytes -= len(data)
        self.written_bytes += len(data)
        return super().write(descriptor, data)

    def sync(self, descriptor):
        self._fail(self.failing)
        super().sync(descriptor)

    def free_bytes(self, folder):
        return self.free

    def _fail(self, number):
        if number is not None:
            raise OSError(number, os.strerror(number))


class SlowDisk(QuickDisk):
    """A worn card: takes bytes_per_s and no more."""

    def __init__(self, bytes_per_s):
        self.bytes_per_s = bytes_per_s

    def write(self, descriptor, data):
        time.sleep(len(data) / self.bytes_per_s)
        return super().write(descriptor, data)


class StuckDisk(QuickDisk):
    """A disk that takes nothing while `lets_go` is not set."""

    def __init__(self):
        self.lets_go = threading.Event()
        self.lets_go.set()
        self.asked = threading.Event()

    def write(self, descriptor, data):
        self.asked.set()
        assert self.lets_go.wait(20)
        return super().write(descriptor, data)
