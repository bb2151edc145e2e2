"""Virtual time for drivers and emulated devices of one process on real ports (pseudo-terminals, local sockets).

As `wallride.sim.virtual.virtual_time`, but bytes on their way through the kernel arrive, and threads end their work,
before time goes on. A folder's conftest chooses it for its tests; all clocks there are the loop's:

    pytest_asyncio_loop_factories = wire_time.chosen
"""

import asyncio
import selectors

from wallride.sim.virtual.virtual_time import VirtualTimeLoop


class WireSelector(selectors.PollSelector):
    """A selector for ports. threads: how many are at work for the loop.

    Linux passes the bytes of a pseudo-terminal on by a worker; poll waits for it, epoll does not.
    """

    now_s, threads = 0.0, 0

    def select(self, timeout=None):
        """Return the ready files; without any, let the time pass for which it would wait."""
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if self.threads or timeout is None:
            return super().select(None)
        self.now_s += max(0.0, timeout)
        return ready


class WireTimeLoop(VirtualTimeLoop):
    """A loop on virtual seconds, for ports."""

    selector = WireSelector

    def run_in_executor(self, executor, func, *args):  # type: ignore[override]  # untyped, as tests are
        """Run in a thread, for which time waits."""
        future = super().run_in_executor(executor, func, *args)
        self._jumping.threads += 1
        future.add_done_callback(self._thread_ended)
        return future

    async def shutdown_default_executor(self, *_):
        """Wait for the threads: the time that Python 3.12 and later give them (300 s) would pass at once."""
        self._jumping.threads += 1
        await super().shutdown_default_executor()
        self._jumping.threads -= 1

    def _thread_ended(self, _future):
        self._jumping.threads -= 1


def run(main):
    """Run a coroutine to its end."""
    with asyncio.Runner(loop_factory=WireTimeLoop) as runner:
        return runner.run(main)


def chosen(config, item):
    """Choose the loop for the tests of a folder; a hook of pytest-asyncio."""
    return {"wire time": WireTimeLoop}


def chosen_for(*names):
    """Return a hook that chooses the loop for files of a folder by name."""

    def hook(config, item):
        return chosen(config, item) if item.path.name in names else {"real time": asyncio.SelectorEventLoop}

    return hook
