"""Emulated lidar of a full circle (RPLIDAR, YDLIDAR): real bytes over a pseudo-terminal or TCP, with faults to inject.

The protocols are in `rplidar` and `ydlidar`, the ports in `scip_port`; this is the head that turns.
"""

import asyncio
import random
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock
from wallride.sim.devices.scip_port import BytePort, SerialDoor, TcpPort

Millimetres = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Rays of a lidar, shape (n,): directions from its zero, counter-clockwise; beginnings, x + iy, at its middle."""

    bearing_rad: Floats
    start_m: npt.NDArray[np.complex128]


See = Callable[[Rays], Millimetres]
"""Measures: rays of the sensor to their lengths; 0 or SCIP's 65533 for no return."""
_GARBAGE_BYTES: Final = 60
_HELD_FRAMES: Final = 4000
_NOWHERE: Final = 65000
"""Distances from here on are SCIP's "no return"."""


class TurningDevice(Protocol):
    """The protocol of an emulated lidar: see `rplidar` and `ydlidar`."""

    streaming: bool
    motor_on: bool
    laser_m: float
    """How far the laser begins to the right of the head's middle."""
    laser_rad: float
    """How far it looks to the left of the head's direction."""

    @property
    def sample_s(self) -> float:
        """Return the time between two samples."""
        ...

    @property
    def turns_hz(self) -> float:
        """Return the speed of the head."""
        ...

    @property
    def baud(self) -> int:
        """Return the speed of the line."""
        ...

    def power_on(self) -> None:
        """Begin as after power-on."""
        ...

    def feed(self, chunk: bytes) -> list[bytes]:
        """Process bytes of commands and return the replies."""
        ...

    def frames(self, head_deg: Floats, mm: Millimetres) -> list[bytes]:
        """Add samples and return the frames that they fill."""
        ...


class TurningHead:
    """The head of a device: what it measures while it turns.

    Faults to set at any time (None or False: off):
        frozen: every turn repeats the distances of the last one before.
        blocked: the head stands, and measures on.
        covered_mm: everything is so near.
        device: its own faults; see `RplidarDevice`, `YdlidarDevice`.
    """

    def __init__(self, device: TurningDevice) -> None:
        self.device = device
        self.frozen = self.blocked = False
        self.covered_mm: int | None = None
        self._head_turns = 0.0
        self._at_s: float | None = None
        self._before: Millimetres = np.zeros(max(1, round(1 / device.turns_hz / device.sample_s)), np.int64)

    @property
    def turns_past_back(self) -> int:
        """Return how often the head has passed the direction opposite to its zero."""
        return int(self._head_turns + 0.5)

    def turn_to(self, now_s: float, see: See) -> list[bytes]:
        """Turn the head to a time, and return the frames that were filled meanwhile."""
        begin_s, self._at_s = self._at_s, now_s
        device = self.device
        if begin_s is None or not device.streaming or not device.motor_on:
            return []
        count = int((now_s - begin_s) / device.sample_s)
        self._at_s = begin_s + count * device.sample_s  # the rest of a sample is left for the next time
        if not count:
            return []
        per_sample = 0.0 if self.blocked else device.turns_hz * device.sample_s
        turns = np.asarray(self._head_turns + per_sample * np.arange(count), np.float64)
        self._head_turns += per_sample * count
        head_deg = np.asarray(turns % 1.0 * 360.0, np.float64)
        return device.frames(head_deg, self._measured(turns, head_deg, see))

    def _lit(self, head_deg: Floats, see: See) -> Millimetres:
        """Return how far from the middle of the head its laser meets something."""
        head = np.exp(-1j * np.radians(head_deg))
        start_m = -1j * self.device.laser_m * head
        mm = see(Rays(np.radians(-head_deg) + self.device.laser_rad, start_m))
        if not self.device.laser_m:
            return mm
        places = start_m * 1000.0 + mm * head * np.exp(1j * self.device.laser_rad)
        return np.where((mm > 0) & (mm < _NOWHERE), np.rint(np.abs(places)).astype(np.int64), 0)

    def _measured(self, turns: Floats, head_deg: Floats, see: See) -> Millimetres:
        place = (turns % 1.0 * self._before.size).astype(np.intp)
        if self.frozen:
            return self._before[place]
        mm = self._lit(head_deg, see)
        if self.covered_mm is not None:
            mm = np.full_like(mm, self.covered_mm)
        mm = np.where(mm >= _NOWHERE, 0, mm)
        self._before[place] = mm
        return mm


class TurningEmulator(TurningHead):
    """Emulates one sensor with one client. Its owner calls `advance` often, and `close` at the end.

    Faults to set at any time (None or False: off):
        silence: what comes is lost and nothing is sent (a pulled cable).
        bad_checksum_every: every n-th frame has one byte changed.
        garbage_every: random bytes before every n-th frame.
        late_s: all frames leave so much later, in order (a slow bridge).
        checks_baud: a serial client at another speed hears nothing.
        those of its head; see TurningHead.
    counts: "frames", "dropped" (the client did not read), "client".
    """

    def __init__(self, device: TurningDevice, *, clock: Clock = time.monotonic, seed: int = 1) -> None:
        super().__init__(device)
        self.silence = self.checks_baud = False
        self.bad_checksum_every: int | None = None
        self.garbage_every: int | None = None
        self.late_s = 0.0
        self.counts: Counter[str] = Counter()
        self._clock = clock
        self._random = random.Random(seed)
        self._port: BytePort | None = None
        self._tcp: TcpPort | None = None
        self._serial: SerialDoor | None = None
        self._held: deque[bytes] | None = None
        self._late: deque[tuple[float, bytes]] = deque()

    @property
    def streaming(self) -> bool:
        """Return whether a client requested samples and is still connected."""
        return self._port is not None and self.device.streaming

    @property
    def connected(self) -> bool:
        """Return whether there is a client; always true on a serial port that is plugged in."""
        return self._port is not None

    async def start_tcp(self, host: str = "127.0.0.1", port: int = 0) -> int:
        """Listen; return the port (a free one for 0)."""
        self._tcp = TcpPort(self._welcome, lambda: self._port is not None)
        return self._tcp.open(host, port)

    def start_serial(self, link: Path) -> None:
        """Appear as a serial port under the name `link`."""
        self._serial = SerialDoor(link)
        self.replug()

    def advance(self, now_s: float, see: See) -> float | None:
        """Turn the head to a time, and send what it measured meanwhile.

        Return the monotonic time right after the last frame was handed to the kernel; None where none was.
        """
        sent_s = None
        for frame in self.turn_to(now_s, see):
            sent_s = self._emit(self._spoil(frame)) or sent_s
        return sent_s

    def disconnect(self) -> None:
        """Disconnect the client."""
        if self._tcp is not None:
            self._farewell()
            self._tcp.drop()

    def refuse(self) -> None:
        """Stop listening; a connected client stays."""
        if self._tcp is not None:
            self._tcp.shut()

    def listen_again(self) -> None:
        """Undo `refuse`, on the same port."""
        if self._tcp is not None:
            self._tcp.reopen()

    def stall(self) -> None:
        """Hold frames back until `release`, as a busy computer does."""
        self._held = self._held or deque(maxlen=_HELD_FRAMES)

    def release(self) -> float | None:
        """Deliver the withheld frames in one burst."""
        held, self._held = self._held or (), None
        return self._send(b"".join(held)) if held else None

    def unplug(self) -> None:
        """Remove the serial port."""
        if self._serial is not None:
            self._farewell()
            self._serial.unplug()

    def replug(self) -> None:
        """Restore the serial port, freshly powered."""
        if self._serial is not None:
            self.unplug()
            self.device.power_on()
            self._welcome(self._serial.plug())

    def close(self) -> None:
        """Close all descriptors."""
        self.refuse()
        self.disconnect()
        self.unplug()

    def _welcome(self, fd: int) -> None:
        self._farewell()
        self.counts["client"] += 1
        self._port = BytePort(fd, self._on_bytes, self._on_gone)

    def _farewell(self) -> None:
        """Forget the client. The stream goes on: a sensor on a serial line does not know who listens."""
        if self._port is not None:
            self._port.close()
            self._port = None
            self._late.clear()

    def _on_gone(self) -> None:
        self.disconnect()
        self.unplug()

    def _on_bytes(self, chunk: bytes) -> None:
        if self._serial is not None:
            self._serial.allow_reopening()
        if self.silence or not self._is_understood():
            return
        for reply in self.device.feed(chunk):
            self._send(reply)

    def _is_understood(self) -> bool:
        return self._serial is None or not self.checks_baud or self._serial.baud() == self.device.baud

    def _spoil(self, frame: bytes) -> bytes:
        self.counts["frames"] += 1
        number = self.counts["frames"]
        if self.bad_checksum_every and number % self.bad_checksum_every == 0:
            at = len(frame) // 2
            frame = frame[:at] + bytes([frame[at] ^ 1]) + frame[at + 1 :]
        if self.garbage_every and number % self.garbage_every == 0:
            frame = self._random.randbytes(_GARBAGE_BYTES) + frame
        return frame

    def _emit(self, frame: bytes) -> float | None:
        if self._held is not None:
            self._held.append(frame)
            return None
        return self._send(frame, may_wait=False)

    def _send(self, data: bytes, *, may_wait: bool = True) -> float | None:
        if self._port is None or self.silence or not self._is_understood():
            return None
        if self._port.busy and not may_wait:
            self.counts["dropped"] += 1
            return None
        if self.late_s or self._late:
            self._late.append((self._clock() + self.late_s, data))
            asyncio.get_running_loop().call_later(self.late_s, self._send_late)
            return None
        return self._clock() if self._port.send(data) else None

    def _send_late(self) -> None:
        while self._late and self._late[0][0] <= self._clock() + 1e-6 and self._port is not None:
            self._port.send(self._late.popleft()[1])
