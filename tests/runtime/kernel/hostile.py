"""Feeds the compiled functions with arguments from hostile rooms, changed at random: for `benchmarks/sanitize.py`.

Run: python -m tests.runtime.kernel.hostile SECONDS SEED

A refusal (TypeError, ValueError, IndexError, OverflowError) is an answer like any other; a call that does not end is a
finding, as is whatever a sanitizer says.
"""

import faulthandler
import math
import os
import sys
import time

import numpy as np
import pytest

os.environ["WALLRIDE_COMPILED"] = "0"

from tests.compiled_laws import import_laws, put_in_place
from tests.runtime.control.localization.rooms import BOXES, ring
from tests.runtime.control.localization.test_localizer import CORNER
from tests.runtime.kernel.sameness import Drive, ranges
from wallride.drivers import accelerated
from wallride.drivers.accelerated import FUNCTIONS
from wallride.runtime.control.corridor_following import bending
from wallride.runtime.control.corridor_following.borders import CourseBorders
from wallride.runtime.control.localization.line_field import field_of_cells
from wallride.runtime.control.localization.localizer import Localizer
from wallride.runtime.control.perception import geometry
from wallride.runtime.control.safety import footprint, promise_judgement, promised_way
from wallride.runtime.control.vehicle import CarSettings

MAX_CALL_S = 20.0
KEPT = 40
SCANS = 30
REFUSALS = (TypeError, ValueError, IndexError, OverflowError, MemoryError, ZeroDivisionError)
NUMBERS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-300, 1e6, -1e6, -1.0, 0.5, 3.0)
WHOLES = (0, 1, -1, 2, 7, 1080, 1081, 2**31, -(2**31), 2**62)


def collect(seed):
    """Return arguments of the C functions, by name, as the laws pass them in hostile rooms."""
    given: dict[str, list[tuple[object, ...]]] = {name: [] for name in FUNCTIONS}

    def listening(name, one):
        def answer(*arguments):
            flat = one.flat(*arguments) if one.flat is not None else arguments
            if len(given[name]) < KEPT:
                given[name].append(flat)
            return one.python(*arguments)

        return answer

    with pytest.MonkeyPatch.context() as patch:
        put_in_place(patch, {name: listening(name, one) for name, one in FUNCTIONS.items()})
        drive = Drive()
        for scan in range(SCANS):
            drive.see_ranges(ranges(seed * 1000 + scan // 3), speed_mps=(0.0, 2.0, 6.0)[scan % 3])
        _locate()
        _look_along_ways(np.random.default_rng(seed))
    return {name: calls for name, calls in given.items() if calls}


def _locate():
    """Search a map for the place of a scan, and follow it from there."""
    room = ring(BOXES)
    localizer = Localizer(field_of_cells(room.cells), CarSettings(), None)
    for scan in range(2 * SCANS):
        localizer.take(room.scan(CORNER, stamp_s=0.025 * scan, noise_m=0.01), None)


def _look_along_ways(random):
    for _ in range(SCANS):
        places_m = random.normal(1.0, 2.0, 400) + 1j * random.normal(0.0, 0.6, 400)
        path = footprint.arc(footprint.PathMotion(4.0, 1.0, 0.05, 0.05, 3.2, 0.33), 0.1, 4.0)
        footprint.first_contact(path, footprint.Outline(0.45, 0.05, 0.2), places_m)
        footprint.slide_room_m(path.place_m, path.heading, places_m, 0.45, 0.2)
        geometry.beside_path_m(places_m, path.place_m)
        car = promised_way.Roadworthy(3.0, 0.05, 0.05, 3.2, 0.33, 0.34, 7.85, 0.023, 4.0)
        promised_way.way_of(path.place_m - path.place_m[0], np.full(path.place_m.size, 3.0), car, 6.0)
        promise_judgement.first_hidden(path.place_m, random.uniform(0.5, 9.0, 361), -1.5, 0.0087)
        bending.bounds_of(path.place_m, path.heading, CourseBorders(places_m[:200], places_m[200:]))


def changed(value, rng):
    """Return another value in the place of one argument."""
    if isinstance(value, np.ndarray):
        return _changed_array(value, rng)
    if isinstance(value, tuple) and value:
        place = rng.integers(len(value))
        kind = rng.integers(4)
        if kind == 0:
            return value[:place]
        if kind == 1:
            return value + value
        return (*value[:place], changed(value[place], rng), *value[place + 1 :])
    if isinstance(value, bool) or value is None:
        return (None, True, False, "text", 1.0)[rng.integers(5)]
    if isinstance(value, int):
        return WHOLES[rng.integers(len(WHOLES))]
    return NUMBERS[rng.integers(len(NUMBERS))]


def _changed_array(array, rng):
    kind = rng.integers(9)
    flat = array.ravel()
    if kind == 0:
        return array[:0]
    if kind == 1:
        return array[: rng.integers(len(array) + 1)]
    if kind == 2:
        return np.concatenate([array, array])
    if kind == 3:
        return array[::2]
    if kind == 4:
        return flat.real.astype((np.float32, np.int64, np.bool_, np.int16)[rng.integers(4)], casting="unsafe")
    if kind == 5:
        return flat.reshape(-1, 1)
    other = array.copy()
    if not other.size:
        return other
    places = rng.random(other.shape) < (0.02 if kind < 8 else 1.0)
    if other.dtype.kind == "f":
        other[places] = NUMBERS[rng.integers(len(NUMBERS))]
    elif other.dtype.kind == "i":
        other[places] = rng.choice([0, -1, 1, 1080, 1081, 2**31 - 1])
    else:
        other[places] = ~other[places] if other.dtype.kind == "b" else other[places]
    return other


def feed(seconds, seed):
    """Call every function again and again; return how often, and how many calls were refused."""
    import_laws()
    rng = np.random.default_rng(seed)
    calls = collect(seed)
    for one in FUNCTIONS.values():
        one.compiled()  # sets the constants
    compiled = {name: getattr(accelerated.extension(), name) for name in FUNCTIONS}
    count, refused = 0, 0
    until_s = time.monotonic() + seconds
    names = list(calls)
    with np.errstate(all="ignore"):
        while time.monotonic() < until_s:
            name = names[count % len(names)]
            arguments = list(calls[name][rng.integers(len(calls[name]))])
            for _ in range(rng.integers(0, 4)):
                place = rng.integers(len(arguments))
                arguments[place] = changed(arguments[place], rng)
            faulthandler.dump_traceback_later(MAX_CALL_S, exit=True)
            try:
                compiled[name](*arguments)
            except REFUSALS:
                refused += 1
            count += 1
    faulthandler.cancel_dump_traceback_later()
    return count, refused, names


if __name__ == "__main__":
    count, refused, names = feed(float(sys.argv[1]), int(sys.argv[2]))
    sys.stdout.write(f"{count} calls of {len(names)} of {len(FUNCTIONS)} functions, {refused} refused\n")
