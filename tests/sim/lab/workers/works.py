"""Work for worker processes: a module of its own, which they can import."""

import os
import signal
import time
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


class DiesAtStart:
    """Work that ends the process that receives it."""

    def __setstate__(self, state):
        os._exit(7)

    def __getstate__(self):
        return {"some": "state"}

    def __call__(self, cell):
        return {}
