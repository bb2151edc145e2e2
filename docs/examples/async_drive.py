"""Drive a car by hand from an asyncio program, and wait before obstacles: python async_drive.py SECONDS."""

import asyncio
import sys
from contextlib import suppress
from dataclasses import dataclass

import wallride
from wallride.clients.remote.car import RemoteCar


@dataclass
class Wish:
    """What the event loop wants of the driving thread."""

    speed_mps: float = 0.0
    steering_rad: float = 0.0
    over: bool = False


def drive(car: RemoteCar, wish: Wish) -> None:
    """Send the newest wish until it is over; in a thread, because beginning, waiting and ending block."""
    with car.drive(max_speed_mps=1.0) as hand:
        for _odom in car.topic("odom", newest=True):
            if wish.over:
                return
            hand.send(wish.speed_mps, wish.steering_rad)


async def main(seconds: float) -> None:
    """Watch the scans while the thread drives."""
    wish = Wish()
    async with await asyncio.to_thread(wallride.connect) as car:
        driving = asyncio.create_task(asyncio.to_thread(drive, car, wish))
        try:
            with suppress(TimeoutError):  # the time is up
                async with asyncio.timeout(seconds):
                    async for scan in car.topic("scan", newest=True):
                        free_m = scan.ranges_m[scan.ranges_m.size // 2]
                        wish.speed_mps = 0.5 if free_m > 1.5 else 0.0  # NaN, no return: 0
                        if driving.done():
                            break
        finally:
            wish.over = True
            await driving  # raises its error, for example DriveRefusedError


asyncio.run(main(float(sys.argv[1])))
