"""A process that drives and records in real time until it is killed; says the number of each scan."""

import asyncio
import sys
import time
from pathlib import Path

from tests.runtime.recording.drives import PERIOD_S, Drive
from wallride.runtime.recording.disk import Disk


async def main():
    drive = Drive(Path(sys.argv[1]), start="always", disk=Disk())
    drive.permit()
    drive.recorder.start()
    telemetry = asyncio.create_task(drive.telemetry.run())
    print("driving", flush=True)  # noqa: T201 - the parent waits for it
    due_s = time.monotonic()
    while not telemetry.done():
        drive.scan()
        print(drive.scans[-1].sequence, flush=True)  # noqa: T201 - what must be in the file a second later
        drive.scans[:-1] = [None] * (len(drive.scans) - 1)
        drive.clock.now_s += PERIOD_S - 0.001
        due_s += PERIOD_S
        await asyncio.sleep(max(0.0, due_s - time.monotonic()))


asyncio.run(main())
