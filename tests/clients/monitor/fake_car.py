"""A car on a real zenoh session, without devices: the real operator's desk, the real parameter desk, invented scans.

Counts as "the wire" what the mux would send: `speed_mps` is arbitrated from the real queue at every look.
"""

import asyncio
import contextlib
import math
import time

import numpy as np

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.arbitration.command import LAB_ORDER, DriveCommand, Source, arbitrate, consent
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.parameters.history import ChangeHistory
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.server import ParameterServer
from wallride.runtime.parameters.server import ServerContext as DeskSurroundings
from wallride.runtime.ros import markers, messages
from wallride.runtime.ros.definitions import encoding
from wallride.runtime.ros.markers import BLUE, GREEN, ORANGE, RED, Marker, MarkerType
from wallride.runtime.settings.operator import OperatorSettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks import parameters
from wallride.runtime.teleop.desk import OperatorDesk
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES

BEAMS = 1081
STEP_RAD = math.radians(0.25)
BEAT_S = 0.02
SCAN_S = 0.05
AUTO_MPS = 1.0


class FakeCar:
    """Serves until closed. autonomy: whether navigation always wants to drive. simulated: whether a simulator answers.

    history: (time, speed) whenever the speed on the wire changed. scans: how many were published. car: its measures.
    pose: that of the status. course: functions that write what it tells of its map at a time since 1970, by topic.
    recordings: answer to `logs/list`. restarts: how often it was started anew.
    """

    def __init__(
        self, endpoint, name="car1", *, permit="required", car_session=0xCAFE, autonomy=False, simulated=False, car=None
    ):
        self.name = name
        self.bus = Bus(zenoh_config.car_config([endpoint], None, (), name))
        self.queue = CommandQueue(LAB_ORDER, time.monotonic)
        self.e_stop = EmergencyStop(self.queue)
        self.permit = Permit(self.queue, permit)
        self.desk = OperatorDesk(
            OperatorSettings(permit=permit), self.queue, self.permit, self.e_stop, lambda: None, time.monotonic,
            car_session,
        )  # fmt: skip
        self.settings = ParameterServer(
            Settings(car=car or CarSettings()),
            DeskSurroundings(self._apply, lambda: self.standing, time.monotonic, lambda: "2026-11-21"),
            ChangeHistory(100),
        )
        self.standing = True
        self.restarts = 0
        self.odom = {"x_m": 0, "y_m": 0, "yaw_rad": 0}
        self.overruled = None
        self.pose, self.course = {}, {}
        self.condition = {}
        self.computer = {"temperature_c": None, "zone": "", "trouble": ""}
        self.applied = []
        self.recording = []
        self.recordings = {"folder": "/none", "files": []}
        self.history = [(time.monotonic(), 0.0)]
        self.scans = 0
        self.beat = None
        self.publishing = True
        self._autonomy = autonomy
        self._simulated = simulated
        self._tasks = []

    async def __aenter__(self):
        bus, name = self.bus, self.name
        bus.subscribe(topics.key(name, topics.COMMAND), self._receive)
        parameters.serve(bus, name, self.settings, RestartDesk(self._why_no_restart, self))
        bus.answer(topics.key(name, "record"), self._record)
        bus.answer(topics.key(name, "logs/list"), lambda _: topics.encode(self.recordings))
        if self._simulated:
            bus.answer(topics.key(name, topics.SIMULATOR), lambda _: topics.encode(SIMULATOR))
        bus.announce(topics.key(name, topics.ALIVE))
        await bus.open()
        self._tasks = [asyncio.create_task(job) for job in (self._beat(), self._publish())]
        return self

    async def __aexit__(self, *_):
        for task in self._tasks:
            task.cancel()
        for result in await asyncio.gather(*self._tasks, return_exceptions=True):
            if isinstance(result, Exception):
                raise result
        await self.bus.close()

    @property
    def decision(self):
        return arbitrate(self.queue.live(), frozenset({Source.SAFETY, Source.PERMIT}), LAB_ORDER)[0]

    @property
    def speed_mps(self):
        return self.history[-1][1]

    async def until(self, condition, what, *, within_s=10.0):
        """Wait for something to be true of the car; return how long that took."""
        before_s = time.monotonic()
        try:
            async with asyncio.timeout(within_s):
                while not condition():
                    await asyncio.sleep(0.002)
        except TimeoutError:
            raise AssertionError(f"never: {what}; {self.desk.view()}") from None
        return time.monotonic() - before_s

    def stopped_at_s(self, since_s):
        """Return when the car was first told to stand after a time; it must have moved before."""
        return next((at_s for at_s, speed_mps in self.history if at_s >= since_s and speed_mps == 0), None)

    def look(self):
        """Note the speed on the wire."""
        speed_mps = self.decision.speed_mps
        if speed_mps != self.history[-1][1]:
            self.history.append((time.monotonic(), speed_mps))

    def _receive(self, key, payload, arrival_s):
        self.desk.receive(key, payload, arrival_s)
        self.look()

    def _why_no_restart(self):
        return "" if self.standing else "only while the car stands; stop it first"

    def check(self):
        """Find nothing wrong with the files of its next start."""

    def begin(self):
        """Note that it is to start anew."""
        self.restarts += 1

    def _apply(self, settings, names):
        self.applied.append(names)

    def _record(self, payload):
        self.recording.append(topics.decode(payload)["on"])
        return topics.encode({"on": self.recording[-1]})

    async def _beat(self):
        while True:
            now_s = time.monotonic()
            self.queue.put(consent(Source.SAFETY, "clear"), expires_at_s=now_s + 0.3)
            if self._autonomy:
                drive = DriveCommand(Source.NAVIGATION, Drive(AUTO_MPS, 0.0), None, "follows the wall")
                self.queue.put(drive, expires_at_s=now_s + 0.3)
            self.desk.tick()
            self.beat = self.desk.beat(self.speed_mps)
            self.bus.put(topics.key(self.name, topics.BEAT), self.beat.pack(), encoding=BYTES, urgent=True)
            for _ in range(4):  # a car's mux looks at least every 10 ms
                self.look()
                await asyncio.sleep(BEAT_S / 4)

    async def _publish(self):
        while True:
            if self.publishing:
                self._publish_once()
            await asyncio.sleep(SCAN_S)

    def _publish_once(self):
        now_s = time.monotonic()
        self._put(topics.STATUS, topics.encode(self._status(now_s)))
        self._put(topics.DECISION, topics.encode(self._decided()))
        self._put(topics.DISTANCE_ERROR, messages.float32(0.05 * math.sin(now_s)))
        self._put(topics.ODOM, messages.odometry(time.time_ns(), now_s % 10, 0.0, 0.1, self.speed_mps, 0.0))
        self._put(topics.OUTPUT, messages.ackermann(time.time_ns(), self.speed_mps, 0.125))
        motor = MotorState(now_s, self.speed_mps, 0.0, 0.125, 11.8, 0.0, 0.0, 30.0, "", timed_out=False, killed=False)
        self._put(topics.MOTOR, messages.motor(time.time_ns(), motor))
        self._put(topics.WALL, markers.marker_array(time.time_ns(), WALL))
        self._put(topics.FOOTPRINT, markers.marker_array(time.time_ns(), FOOTPRINT))
        self.scans += 1
        ranges_m = corridor(self.scans)
        scan = Scan(now_s, now_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, ranges_m, self.scans)
        stamp_ns = time.time_ns()
        for topic, write in self.course.items():
            self._put(topic, write(stamp_ns))
        self._put(topics.SCAN, messages.laser_scan(stamp_ns, scan, SCAN_S))

    def _put(self, topic, payload):
        with contextlib.suppress(ConnectionError):
            self.bus.put(topics.key(self.name, topic), payload, encoding=encoding(topic))

    def _decided(self):
        decision = self.decision
        return {
            "stamp_s": time.monotonic(), "winner": decision.winner or "nobody", "driver": decision.driver,
            "reason": decision.reason, "measure": decision.measure, "asked_mps": decision.speed_mps,
            "allowed_mps": decision.speed_mps, "speed_mps": decision.speed_mps, "steering_rad": 0.125,
            "delivered": True,
        }  # fmt: skip

    def _status(self, now_s):
        ages_s = self.queue.ages_s()
        live = {word.source: word for word in self.queue.live()}
        return {
            "car": self.name, "version": "9.9", "stamp_s": now_s, "up_s": 1.0, "state": "driving",
            "output": self._decided(), "gates": {"lidar": "", "motor": ""},
            "voices": {
                str(source): {"age_s": ages_s.get(source), "live": source in live}
                | ({"caps": True, "speed_mps": None, "reason": "clear", "measure": None} if source in live else {})
                for source in LAB_ORDER
            },
            "operator": self.desk.view().fields(), "overruled": self.overruled, "speed_mps": self.speed_mps,
            "battery": {"voltage_v": 11.75, "current_a": 3.2}, "fault": "",
            "lidar": {"link": "ready", "message": "UST-10LX", "identity": "", "counts": {}},
            "motor": {"link": "ready", "message": "VESC 60", "identity": "", "counts": {"missed_reply": 2}},
            "condition": self.condition, "window": WINDOW, "computer": self.computer, "link": {}, "scans": self.scans,
            "scan_to_motor_ms": {"p50": 1.1, "p99": 2.2, "max": 3.3},
            "distance_error": {"mean_abs_m": 0.021, "rms_m": 0.03}, "odom": self.odom, "pose": self.pose,
        }  # fmt: skip


SIMULATOR = {
    "actions": [{"name": "box", "words": "a box 1 m ahead"}, {"name": "clear", "words": "clear all"}],
    "conditions": {"friction": "1.00", "noise": "10 mm"},
}


def corridor(number):
    """Return a scan between two walls, open ahead; nothing comes back from far, and it is never twice the same."""
    bearing_rad = (np.arange(BEAMS) - BEAMS // 2) * STEP_RAD
    with np.errstate(divide="ignore"):
        ranges_m = np.where(np.sin(bearing_rad) > 0, 1.0, 1.2) / np.abs(np.sin(bearing_rad))
    ranges_m[ranges_m > 9.0] = np.nan
    noisy = ranges_m * (1 + 0.003 * np.random.default_rng(number).standard_normal(BEAMS))
    return noisy.astype(np.float32)


def _points(*places):
    return np.array(places, dtype=float).T


WALL = [
    Marker("wall", MarkerType.LINE_STRIP, _points((-1.0, 1.0), (3.0, 1.0)), GREEN),
    Marker("ball", MarkerType.LINE_STRIP, _points((0.4, 0.0), (1.0, 0.02), (1.8, 0.1)), BLUE),
]
WINDOW = [
    "12 beams around 30 deg are dirty: clean the window",
    "9 beams around 160 deg see the car itself, or dirt, and are ignored",
]
DIRT_RAD = math.radians(30) + STEP_RAD * (np.arange(12) - 6)
DIRT = np.array([0.27 + 0.5 * np.cos(DIRT_RAD), 0.5 * np.sin(DIRT_RAD)])
FOOTPRINT = [
    Marker("car", MarkerType.LINE_STRIP, _points((0.42, 0.15), (0.42, -0.15), (-0.13, -0.15), (-0.13, 0.15)), BLUE),
    Marker("left edge", MarkerType.LINE_STRIP, _points((0.42, 0.15), (0.9, 0.2), (1.4, 0.35)), ORANGE),
    Marker("right edge", MarkerType.LINE_STRIP, _points((0.42, -0.15), (0.9, -0.1), (1.45, 0.05)), ORANGE),
    Marker("the beam that stops", MarkerType.LINE_STRIP, _points((0.27, 0.0), (1.5, 0.4)), RED),
    Marker("what stops", MarkerType.POINTS, _points((1.5, 0.4)), RED),
    Marker(
        "ignored", MarkerType.POINTS,
        np.hstack([DIRT, _points((0.27, 1.0), (0.15, 0.14), (0.15, -0.14))]),  # dirt, a stray echo, the car itself
        ORANGE,
    ),
]  # fmt: skip
