"""The car's surroundings in a soak: a simulated world behind emulated devices, down to the bytes.

The clock is injected: the same scene serves a car of this process in virtual time and a real process in real time.
"""

import asyncio
import contextlib
import math
import os
import socket
from collections.abc import Callable
from typing import Final

import numpy as np

from tests.system.socket_motor import SocketVesc
from wallride.drivers.api import Clock, LinkLost
from wallride.drivers.vesc.codec import Packet, VescDeframer
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.plant import Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS
from wallride.sim.world.beams import Millimetres, scan
from wallride.sim.world.obstacles import ObstacleWorld
from wallride.sim.world.worlds import load_world

SCAN_PERIOD_S: Final = 0.02503
"""Not exactly 40 Hz, as with a real motor: the scans pass through every phase of the car's timers."""
GOOD_VOLTAGE_V: Final = 11.8
COVERED_MM: Final = 65533
HAND_MM: Final = 60
PUT_BACK_AFTER_S: Final = 2.0
"""Time after which a car that touched something is put back to the start, as a person does."""
WIRING: Final = VescSettings(servo_min=0.1, servo_max=0.95)

Witness = Callable[[float, bytes], None]


class WitnessedVesc(VescEmulator):
    """An emulated motor controller that reports every received payload.

    witness: called with (time, payload) in the order of their arrival. voltage_v: of the battery.
    before: called before each payload, to move the world on. opened, hung_up: called when the car opens and when it
    closes the port. fault_shown: called when a fault code leaves in a good reply: it is shown for half a second only.
    """

    witness: Witness = staticmethod(lambda _at_s, _payload: None)
    before: Callable[[], None] = staticmethod(lambda: None)
    opened: Callable[[], None] = staticmethod(lambda: None)
    hung_up: Callable[[], None] = staticmethod(lambda: None)
    fault_shown: Callable[[], None] = staticmethod(lambda: None)
    voltage_v = GOOD_VOLTAGE_V

    def report(self, erpm=0.0, tachometer=0, voltage_v=None, **others):
        super().report(erpm, tachometer, self.voltage_v if voltage_v is None else voltage_v, **others)

    def _on_readable(self) -> None:
        assert self._master is not None
        try:
            data = os.read(self._master, 4096)
        except ConnectionResetError:
            data = b""
        if not data:
            self._loop.remove_reader(self._master)
            self.hung_up()
        for payload in self._deframer.feed(data):
            self._on_payload(payload)

    def forget_unread(self) -> None:
        """Drop what came while it was deaf: a host that gives a port up throws its unsent bytes away."""
        if self._master is not None:
            with contextlib.suppress(BlockingIOError, ConnectionResetError):
                while os.read(self._master, 65536):
                    pass

    def transmit(self, payload: bytes) -> None:
        super().transmit(payload)
        is_whole = payload[0] == Packet.GET_VALUES and not (self.bad_crc or self.garbage)
        if is_whole and self._logic.fault_code(self._clock()):
            self.fault_shown()

    def write(self, data: bytes) -> None:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # the car has closed the port
            super().write(data)

    def _on_payload(self, payload: bytes) -> None:
        self.before()
        self.witness(self._clock(), payload)
        super()._on_payload(payload)


class MemoryVesc(WitnessedVesc):
    """Its port is a pair of connected sockets in this process: written bytes can be read at once."""

    _plugged = False

    def start(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._plugged = True

    def connect(self) -> socket.socket:
        """Return the car's end; LinkLost while unplugged."""
        if not self._plugged:
            raise LinkLost("memory: no such device")
        self._drop()
        self.opened()
        ours, theirs = _pair()
        self._deframer = VescDeframer()
        self._master = ours.detach()
        if not self.deaf:
            self._loop.add_reader(self._master, self._on_readable)
        return theirs

    def unplug(self) -> None:
        self._plugged = False
        self._drop()

    def _drop(self) -> None:
        if self._master is not None:
            self._loop.remove_reader(self._master)
            os.close(self._master)
            self._master = None


class ListeningVesc(WitnessedVesc, SocketVesc):
    """Its port is a local socket, for a car in another process."""

    def _accept(self) -> None:
        self.opened()
        self._deframer = VescDeframer()
        super()._accept()


class MemoryLidar(ScipEmulator):
    """An emulated sensor whose port is a pair of connected sockets in this process."""

    _refuses = False
    _end: socket.socket | None = None

    def connect(self) -> socket.socket:
        """Return the car's end; LinkLost while it refuses."""
        if self._refuses:
            raise LinkLost("memory: connection refused")
        self.disconnect()
        self._end, theirs = _pair()
        self._welcome(self._end.fileno())
        return theirs

    def disconnect(self) -> None:
        self._farewell()
        if self._end is not None:
            self._end.close()
            self._end = None

    def refuse(self) -> None:
        self._refuses = True

    def listen_again(self) -> None:
        self._refuses = False


class Scene:
    """World, car body and both devices; `step` once per revolution of the lidar.

    good_scan_s: when the newest scan that reached the wire whole was measured. cover: changes what the lidar sees.
    mute: the lidar turns without sending. stamp_jump_ms: what the sensor's clock is off.
    way_m: driven. contacts: how often the car touched something. touched: called at each.
    """

    def __init__(self, scip: ScipEmulator, vesc: WitnessedVesc, clock: Clock, seed: int) -> None:
        self.scip, self.vesc = scip, vesc
        self.good_scan_s = -math.inf
        self.cover: Callable[[Millimetres], Millimetres] | None = None
        self.mute = False
        self.stamp_jump_ms = 0
        self.way_m = 0.0
        self.contacts = 0
        self.touched: Callable[[], None] = lambda: None
        self._clock = clock
        self._began_s = clock()
        self._rng = np.random.default_rng(seed)
        self._world = load_world("loop")
        self._surroundings = ObstacleWorld(self._world, ())
        self.vehicle = Vehicle(None, self._world.start)
        self._plant = Plant(self.vehicle, vesc, WIRING, clock())
        self._touched_s = math.inf
        self._last_mm: Millimetres | None = None
        self._spoiled = 0
        self._held_s = -math.inf
        vesc.before = self.advance

    @property
    def now_s(self) -> float:
        """The present time."""
        return self._clock()

    def advance(self) -> None:
        """Move the car on to now."""
        self._plant.advance(self._clock())

    def step(self) -> None:
        """Move on, look for a contact, and send one scan."""
        now_s = self._clock()
        self.advance()
        vehicle = self.vehicle
        if not self._plant.crashed:
            self.way_m += abs(vehicle.speed_mps) * SCAN_PERIOD_S
            if self._surroundings.clearance(vehicle.pose) <= 0.0:
                self.contacts += 1
                self.touched()
                self._plant.crash()
                self._touched_s = now_s
        elif now_s - self._touched_s > PUT_BACK_AFTER_S:
            vehicle.place(self._world.start)
            self._plant.crashed = False
        self._send(now_s)

    def _send(self, now_s: float) -> None:
        if self.mute:
            return
        vehicle = self.vehicle
        ranges_mm = scan(self._surroundings, vehicle.pose, vehicle.twist, now_s, self._rng, ROUGH_BEAMS)
        if self.cover is not None:
            ranges_mm = self.cover(ranges_mm)
        number = self.scip.counts["published"] + 1
        stamp_ms = round((now_s - self._began_s) * 1000) + self.stamp_jump_ms
        sent = self.scip.publish(ranges_mm, stamp_ms % 2**24)
        every = self.scip.bad_checksum_every
        if sent is not None and not (every and number % every == 0):
            self.good_scan_s = now_s
        self._held_s = now_s

    def release(self) -> None:
        """Deliver the scans that the lidar held back; the newest is fresh."""
        if self.scip.release() is not None:
            self.good_scan_s = self._held_s


def covered(ranges_mm: Millimetres) -> Millimetres:
    """No echo anywhere."""
    return ranges_mm * 0 + COVERED_MM


def hand(ranges_mm: Millimetres) -> Millimetres:
    """Something right before the window."""
    return ranges_mm * 0 + HAND_MM


def _pair() -> tuple[socket.socket, socket.socket]:
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    theirs.setblocking(False)
    return ours, theirs
