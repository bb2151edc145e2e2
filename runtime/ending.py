"""Ends of tasks that come although the first request got lost.

A cancellation is one exception at one `await`: code that catches it by mistake, or a library that loses it (in Python
3.11 `asyncio.wait_for`, when the awaited future has just finished), goes on for ever, and so does the task that
awaits its end. So it is asked for again.
"""

import asyncio
from typing import Any, Final

AGAIN_S: Final = 2.0
"""Time after which a task is cancelled again: longer than an orderly end takes, which a second request cuts short."""


async def end(*tasks: asyncio.Task[Any]) -> list[BaseException]:
    """Cancel tasks until all have ended; return the errors with which they did.

    Where this itself is cancelled, that is obeyed once the tasks have ended.
    """
    cancelled: asyncio.CancelledError | None = None
    while pending := [task for task in tasks if not task.done()]:
        for task in pending:
            task.cancel()
        try:
            await asyncio.wait(pending, timeout=AGAIN_S)
        except asyncio.CancelledError as request:
            cancelled = request
    if cancelled is not None:
        raise cancelled
    return [error for task in tasks if not task.cancelled() and (error := task.exception()) is not None]
