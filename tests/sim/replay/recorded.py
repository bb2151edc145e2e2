"""Drives of the whole process in virtual time, written down as the recorder does: for tests of whatever reads them."""

import argparse
import asyncio
from importlib.metadata import version

from wallride.runtime.app import Car, CarSurroundings
from wallride.runtime.line_files import course_of
from wallride.runtime.recording import channels
from wallride.runtime.recording.channels import RecordMessage
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.laws_fingerprint import laws_fingerprint
from wallride.runtime.recording.mcap_file import McapFile
from wallride.runtime.recording.transcriber import Transcriber
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire import topics
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.virtual.devices import MemoryBus
from wallride.sim.virtual.twin_world import TwinWorld, WorldLidar, WorldMotor
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.worlds import load_world

SETTINGS = {"battery": {"settle_s": 0}, "operator": {"permit": "always"}, "wall_follow": {"speed_mps": 1.5}}


class Sink:
    """Takes everything that telemetry says, as the recorder does; scans come from the decision log."""

    def __init__(self, file, wall_clock):
        self.file = file
        self.wall_clock = wall_clock

    def claim(self, topic, at_s, *, urgent=False):
        return topic != topics.SCAN

    def take(self, topic, schema, stamp_s, payload):
        if topic not in TYPES:
            schema, payload = channels.STRING, channels.text(payload)
        self.file.add(RecordMessage(topic, schema, self.wall_clock.started_unix_ns(stamp_s), payload))


class Restless:
    """A clock that is a little later at every look, as a real one is."""

    def __init__(self, loop_time):
        self.loop_time = loop_time
        self.looks = 0

    def __call__(self):
        self.looks += 1
        return self.loop_time() + 1e-7 * self.looks


def record(
    path, *, world="loop", seconds=6.0, events=(), obstacles=(), sections=None, start=None, forgets=0,
    known=None, line=None,
):  # fmt: skip
    """Drive and write it down; returns the car and its world.

    events are (time, function of the car). forgets: so many events behind the settings are not in the decision log.
    known: a map to find the pose on; line: its race line.
    """
    settings = Settings.model_validate({**SETTINGS, **(sections or {})})
    kept = {}

    async def main():
        loop = asyncio.get_running_loop()
        decision_log = DecisionLog(Restless(loop.time), most=1_000_000)
        twin = TwinWorld(load_world(world, side="left", seed=0), loop.time, obstacles=obstacles, start=start)
        decision_log.add_settings(settings)
        motor = WorldMotor(twin, loop.time)
        course = course_of(known, settings.map.start, settings.car, line) if known is not None else None
        around = CarSurroundings(course=course)
        car = Car(settings, WorldLidar(twin, loop.time), motor, MemoryBus(loop.time), decision_log.clock, around)
        car.connect()
        facts = {"car": settings.car.name, "version": version("wallride"), "laws": laws_fingerprint()}
        file = McapFile(path, Disk(), facts, "wallride")
        car.telemetry.sinks.append(Sink(file, car.wall_clock))
        tape_over(car, decision_log)
        stop = asyncio.Event()
        for at_s, event in events:
            loop.call_at(at_s, event, car)
        loop.call_at(seconds, stop.set)
        await car.drive(stop)
        settings_first, *others = decision_log.drain()
        for message in Transcriber(car.wall_clock, 0.0).messages([settings_first, *others[forgets:]]):
            file.add(message)
        file.close()
        kept.update(car=car, twin=twin)

    run_virtual(main())
    return kept["car"], kept["twin"]


def tape_over(car, decision_log):
    """Put everything that decides into the decision log."""
    look, follow, step = (
        car.laws.look, car.laws.follow, car.mux.step
    )  # fmt: skip
    apply = car.apply
    last: list[float | None] = [None]

    def taped_look(scan, motor):
        decision_log.begin()
        assessment = look(scan, motor)
        decision_log.add_safety(scan, motor)
        return assessment

    def taped_follow(scan, motor):
        decision_log.begin()
        guidance = follow(scan, motor)
        decision_log.add_follower(scan, motor, guidance)
        return guidance

    def taped_step():
        decision_log.begin()
        output = step()
        elapsed_s = output.stamp_s - last[0] if last[0] is not None else 0.0
        last[0] = output.stamp_s
        decision_log.add_decision(elapsed_s, car.queue.live(), output)
        return output

    def taped_apply(settings, changed):
        apply(settings, changed)
        decision_log.add_settings(settings)

    car.laws.look, car.laws.follow, car.mux.step = taped_look, taped_follow, taped_step
    car.apply = taped_apply
    run_lidar = car.lidar.run

    async def run(on_scan):
        def deliver(scan):
            decision_log.add_scan(scan)
            on_scan(scan)

        await run_lidar(deliver)

    car.lidar.run = run


def options(file, **changes):
    """Return what a command line would say."""
    values = {
        "file": file, "assignments": [], "topic": None, "car": None, "speed": 50.0, "loop": False, "begin_s": 0.0,
        "listen": free_endpoint(),
    }  # fmt: skip
    return argparse.Namespace(**{**values, **changes})
