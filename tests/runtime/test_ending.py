import asyncio

import pytest

from wallride.runtime.ending import AGAIN_S, end
from wallride.sim.virtual.virtual_time import run_virtual


async def deaf(times):
    """Swallow that many cancellations."""
    while True:
        try:
            await asyncio.sleep(1e6)
        except asyncio.CancelledError:
            if (times := times - 1) < 0:
                raise


async def failing():
    try:
        await asyncio.sleep(1e6)
    finally:
        raise OSError("the port is gone")


def test_tasks_that_lose_their_cancellation_are_asked_again():
    async def main():
        tasks = [asyncio.create_task(deaf(times)) for times in (0, 1, 3)]
        await asyncio.sleep(1)
        begin_s = asyncio.get_running_loop().time()
        assert await end(*tasks) == []
        assert all(task.cancelled() for task in tasks)
        return asyncio.get_running_loop().time() - begin_s

    assert run_virtual(main()) == pytest.approx(3 * AGAIN_S)


def test_the_errors_of_the_end_are_returned():
    async def main():
        task, ended = asyncio.create_task(failing()), asyncio.create_task(asyncio.sleep(0))
        await asyncio.sleep(1)
        return await end(task, ended)

    assert [str(error) for error in run_virtual(main())] == ["the port is gone"]


def test_an_end_that_is_cancelled_itself_ends_its_tasks_first():
    async def main():
        tasks = [asyncio.create_task(deaf(1))]
        await asyncio.sleep(1)
        ending = asyncio.create_task(end(*tasks))
        await asyncio.sleep(0.1)
        ending.cancel()
        with pytest.raises(asyncio.CancelledError):
            await ending
        return tasks[0].cancelled()

    assert run_virtual(main())
