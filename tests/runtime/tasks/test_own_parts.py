"""Own parts from one run to the next: read before the first scan, written when they have changed, forgotten."""

import asyncio
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from wallride.drivers.api import Scan
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.recording import own_parts_memory
from wallride.runtime.recording.own_parts_memory import FILE, RememberedParts, file_in, read, write
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks import own_parts
from wallride.runtime.tasks.own_parts import UNCHANGED_S, OwnPartsKeeper
from wallride.runtime.wire.network import RefusedError

STEP_RAD = math.radians(0.25)
KNOWN = KnownParts(-STEP_RAD * 540, STEP_RAD, 1081, tuple((beam, 0.3) for beam in range(20, 60)))
MINE, OTHER = "UST-10LX, firmware 1, serial H1", "UST-10LX, firmware 1, serial H2"
CAR = CarSettings().name


class Run:
    """One run of the process, as far as own parts go."""

    def __init__(self, file, identity=MINE):
        settings = Settings()
        self.now_s = 0.0
        self.stands = True
        self.told = []
        self.identity = identity
        self.laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
        self.keeper = OwnPartsKeeper(
            CAR, lambda: self.identity, self.laws, file, lambda: self.now_s, lambda: "2026-01-02", lambda: self.stands,
            self.told.append,
        )  # fmt: skip

    def scan(self, beams=1081):
        scan = Scan(0.0, 0.0, -STEP_RAD * (beams // 2), STEP_RAD, 0.02, 30.0, np.full(beams, 3.0, np.float32), 0)
        self.keeper.meet(scan)
        self.laws.look(scan, None)
        return self.known.ranges_m

    @property
    def known(self):
        assert self.laws.own_parts is not None
        return self.laws.own_parts

    @property
    def guard(self):
        assert isinstance(self.laws.guard, SweptGuard)
        return self.laws.guard


@pytest.fixture
def file(tmp_path):
    write(tmp_path / FILE, RememberedParts(CAR, MINE, "2026-01-01", KNOWN))
    return tmp_path / FILE


def test_a_part_of_few_beams_apart_from_each_other_has_a_distance_too(tmp_path):
    apart = replace(KNOWN, ranges_m=tuple((beam, 0.9) for beam in (122, 123, 128, 133, 139, 144, 153)))
    write(tmp_path / FILE, RememberedParts(CAR, MINE, "2026-01-01", apart))
    run = Run(tmp_path / FILE)
    run.scan()
    (patch, last) = run.keeper.status()["patches"]
    assert (patch["beams"], patch["range_m"]) == (6, 0.9)
    assert (last["beams"], last["range_m"]) == (1, 0.9)


def test_what_was_written_is_known_with_the_first_scan(file):
    run = Run(file)
    assert run.scan() == KNOWN.ranges_m
    assert run.told == [KNOWN]
    status = run.keeper.status()
    assert status["patches"] == [{"beams": 40, "bearing_deg": -125.1, "range_m": 0.3}]
    assert status["remembered"] == "2026-01-01"


def test_another_lidar_or_another_car_has_other_parts(file, tmp_path):
    assert Run(file, OTHER).scan() == ()
    write(tmp_path / "other.json", RememberedParts("another", MINE, "2026-01-01", KNOWN))
    assert Run(tmp_path / "other.json").scan() == ()


def test_another_lidar_during_the_run_has_none_of_the_first_ones_parts(file):
    run = Run(file)
    assert run.scan()
    run.identity = OTHER
    assert run.scan() == ()
    assert run.told == [KNOWN, None]


async def written(run, monkeypatch):
    """Let the keeper look at what is to be written until it has written it."""
    monkeypatch.setattr(own_parts, "LOOKS_EVERY_S", 0.0)
    loop, done = asyncio.get_running_loop(), asyncio.Event()

    def write_and_tell(file, stored):
        write(file, stored)
        loop.call_soon_threadsafe(done.set)

    monkeypatch.setattr(own_parts_memory, "write", write_and_tell)
    keeping = asyncio.create_task(run.keeper.keep())
    async with asyncio.timeout(10.0):
        await done.wait()
    keeping.cancel()


async def test_what_has_changed_is_written_when_it_has_settled(tmp_path, monkeypatch):
    run = Run(tmp_path / FILE)
    run.scan()
    parts = run.guard.perception.own_parts
    parts.remember(replace(KNOWN, ranges_m=tuple((beam, 0.41) for beam in range(30, 50))))
    run.scan()
    parts.changes += 1
    assert not run.keeper.is_due()
    run.now_s = UNCHANGED_S + 0.1
    await written(run, monkeypatch)
    assert not run.keeper.is_due(), "once"
    again = read(tmp_path / FILE)
    assert again == RememberedParts(CAR, MINE, "2026-01-02", run.known)
    assert again is not None
    assert len(again.parts.ranges_m) == 20


async def test_forgetting_is_for_a_standing_car_and_takes_the_dirt_along(file, monkeypatch):
    run = Run(file)
    run.scan()
    run.stands = False
    with pytest.raises(RefusedError, match="the car moves"):
        run.keeper.answer_forget(b"")
    run.stands = True
    health = run.guard.perception.health
    health.ceiling_mps, health.reason = 0.0, "too much dirt: clean the lidar"
    assert json.loads(run.keeper.answer_forget(b""))["patches"] == []
    assert (health.ceiling_mps, run.scan()) == (math.inf, ())
    run.now_s = UNCHANGED_S + 0.1
    await written(run, monkeypatch)
    assert not file.exists()


OUTSIDE = {"angle_min_rad": 0, "angle_step_rad": 0.1, "beams": 3, "ranges_m": [[7, 0.3]]}
NO_MEMORY = json.dumps({"car": "car1", "lidar": "x", "at": "", "parts": OUTSIDE}).encode()


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b"\xff\xfe", NO_MEMORY, b"[" * 100_000])
def test_a_damaged_file_is_no_memory(tmp_path, content):
    (tmp_path / FILE).write_bytes(content)
    assert read(tmp_path / FILE) is None


def test_it_is_kept_where_the_settings_or_the_service_say_and_else_nowhere(tmp_path):
    assert file_in("", {}) is None
    assert file_in("", {"STATE_DIRECTORY": f"{tmp_path}:/other"}) == tmp_path / FILE
    assert file_in(str(tmp_path), {"STATE_DIRECTORY": "/other"}) == tmp_path / FILE
