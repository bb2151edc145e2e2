"""CPU latency limit against deep idle states: their exit takes 0.1 ms on a virtual machine, milliseconds on a Jetson.

Two scans are 25 ms apart, long enough for a core to enter its deepest idle state, from which every scan would have to
wake it. Linux lets a process forbid that for as long as it holds a file open (Documentation/power/pm_qos_interface,
"CPU latency"); cyclictest does the same. The limit ends with the process, however that ends.
"""

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

LATENCY: Final = Path("/dev/cpu_dma_latency")
MAX_LATENCY_US: Final = 0
REMEDY: Final = "let the user write to it (systemd/wallride.service does), or set process.stay_awake = false"


@contextmanager
def awake(*, wanted: bool, device: Path = LATENCY) -> Iterator[str]:
    """Keep the cores out of deep idle states inside the block; yields a sentence with the result.

    Never fails: the car drives without it too.
    """
    if not wanted:
        yield "the processor may doze between two scans (process.stay_awake = false)"
        return
    try:
        held = os.open(device, os.O_WRONLY)
    except FileNotFoundError:
        yield f"the processor may doze between two scans ({device} is not there)"
        return
    except OSError as error:
        yield f"the processor may doze between two scans: {device}: {error.strerror} ({REMEDY})"
        return
    try:
        os.write(held, struct.pack("=i", MAX_LATENCY_US))
        yield "the processor is kept awake between two scans"
    finally:
        os.close(held)
