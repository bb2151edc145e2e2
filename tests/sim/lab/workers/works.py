"""Work for worker processes: a module of its own, which they can import."""

import os
import signal
import time
from contextlib import suppress
from pathlib import Path


def double(number):
    if number < 0:
        raise ValueError(f"{number} is below zero")
    return {"twice": 2 * number}


def slowly(number):
    time.sleep(0.02)
    return double(number)


def where(_):
    time.sleep(0.02)
    return {"pid": os.getpid()}


def dies(cell):
    """Kill the own process where the cell says so: "always", or where its file is not there yet."""
    number, deadly = cell
    if deadly == "always":
        os.kill(os.getpid(), signal.SIGKILL)
    if deadly and not Path(deadly).exists():
        Path(deadly).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return double(number)


class KilledAtStart:
    """Work that kills processes that receive it: `count` of them."""

    def __init__(self, folder, count):
        self.folder, self.count = folder, count

    def __setstate__(self, state):
        self.__dict__.update(state)
        for number in range(self.count):
            with suppress(FileExistsError):
                (self.folder / str(number)).touch(exist_ok=False)
                os.kill(os.getpid(), signal.SIGKILL)

    def __call__(self, cell):
        return double(cell)


class DiesAtStart:
    """Work that ends the process that receives it."""

    def __setstate__(self, state):
        os._exit(7)

    def __getstate__(self):
        return {"some": "state"}

    def __call__(self, cell):
        return {}
