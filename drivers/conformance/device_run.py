"""What the conformance tests of every kind of device share: a driver that runs against a bench, and its test."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Generic, TypeVar

from wallride.drivers.api import LinkState
from wallride.drivers.conformance.bench import DeviceBench
from wallride.drivers.conformance.port import now_s, run_test

ENDS_S = 2.0
STEP_S = 0.004

BenchT = TypeVar("BenchT", bound=DeviceBench)


class DeviceRun(Generic[BenchT]):
    """A driver that runs against a bench.

    patience_s: for what has no limit of its own. sinks: the arguments of the driver's `run`.
    """

    patience_s = 8.0

    def __init__(self, bench: BenchT, *sinks: Callable[..., object]) -> None:
        self.bench, self.driver = bench, bench.driver()
        self.task: asyncio.Task[Any] = asyncio.create_task(self.driver.run(*sinks))

    def judge(self) -> None:
        """Raise AssertionError for what the driver has done wrong so far."""

    async def until(self, done: Callable[[], bool], what: str, patience_s: float | None = None) -> None:
        """Let the device go on until something is so; AssertionError where it does not become so."""
        patience_s = patience_s or self.patience_s
        end_s = now_s() + patience_s
        while not done():
            if self.task.done() and not self.task.cancelled():
                self.task.result()
            assert not self.task.done(), "run() ended, which has no end"
            self.judge()
            assert now_s() < end_s, f"{what}: not within {patience_s:g} s; {self.driver.health.message}"
            self.bench.step(now_s())
            await asyncio.sleep(STEP_S)

    async def run_for(self, duration_s: float) -> None:
        """Let the device go on for a time."""
        end_s = now_s() + duration_s
        await self.until(lambda: now_s() >= end_s, "time")

    def is_ready(self) -> bool:
        """Return whether the driver says that all is well."""
        return bool(self.driver.health.link is LinkState.READY)

    async def end(self) -> None:
        """Cancel the driver, and see that it ends."""
        self.task.cancel()
        end_s = now_s() + ENDS_S
        while not self.task.done() and now_s() < end_s:
            self.bench.step(now_s())
            await asyncio.sleep(STEP_S)
        assert self.task.done(), "it does not end when it is cancelled"
        assert self.task.cancelled(), "it swallows its cancellation"


RunT = TypeVar("RunT", bound=DeviceRun[Any])


class DeviceConformance(Generic[BenchT, RunT]):
    """Tests of a kind of device."""

    run_class: Callable[[BenchT], RunT]

    def bench(self) -> BenchT:
        """Return a new bench."""
        raise NotImplementedError

    def drive(self, body: Callable[[RunT], Awaitable[None]]) -> None:
        """Run a test against a new bench and a new driver."""

        async def run() -> None:
            bench = self.bench()
            await bench.start()
            drive = self.run_class(bench)
            try:
                await body(drive)
            finally:
                drive.task.cancel()
                await asyncio.wait({drive.task}, timeout=ENDS_S)
                await bench.close()

        run_test(run())
