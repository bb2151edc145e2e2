"""Emulated Hokuyo lidar: real SCIP bytes over TCP or a pseudo-terminal, with every known fault to inject.

The protocol state is in `scip_sensor`, the encoding in `scip_encode`, the ports in `scip_port`; this is the device.
"""

import asyncio
import random
import time
from collections import Counter, deque
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock
from wallride.sim.devices.scip_encode import UST_10LX, SensorModel
from wallride.sim.devices.scip_port import BytePort, SerialDoor, TcpPort
from wallride.sim.devices.scip_sensor import ScipSensor

_HELD_SCANS: Final = 400
_GARBAGE_BYTES: Final = 200


class ScipEmulator:
    """Emulates one sensor with one client. Its owner calls `publish` once per revolution, and `close` at the end.

    Faults to set at any time (None or False: off):
        silence: connections are accepted, commands and scans go nowhere (a pulled cable).
        bad_checksum_every: every n-th scan has one character changed.
        garbage_every: random bytes before every n-th scan.
        late_s: all bytes leave so much later, in order (a slow network).
        dribble_s: bytes leave one by one, a scan takes about this long.
        frozen: every scan repeats the ranges of the last one before, with stamps that go on.
        baud: a serial client at another speed hears nothing.
        sensor: its `fault`, `scip1`, `state_text`, `model` and others may be changed; see ScipSensor.
    counts: "published", "dropped" (the client did not read), "refused client", "client", "reboot".
    """

    def __init__(self, model: SensorModel = UST_10LX, *, clock: Clock = time.monotonic, seed: int = 1) -> None:
        self.sensor = ScipSensor(model, clock, self._reboot)
        self.silence = False
        self.bad_checksum_every: int | None = None
        self.garbage_every: int | None = None
        self.dribble_s: float | None = None
        self.late_s = 0.0
        self.frozen = False
        self.baud: int | None = None
        self.counts: Counter[str] = Counter()
        self._clock = clock
        self._random = random.Random(seed)
        self._port: BytePort | None = None
        self._tcp: TcpPort | None = None
        self._serial: SerialDoor | None = None
        self._held: deque[bytes] | None = None
        self._late: deque[tuple[float, bytes]] = deque()  # when each leaves
        self._rebooting = False

    @property
    def streaming(self) -> bool:
        """Return whether a client requested scans and is still connected."""
        return self._port is not None and self.sensor.measurement is not None

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

    def publish(self, ranges_mm: npt.NDArray[np.integer], stamp_ms: int) -> float | None:
        """Send one revolution: millimetres of all steps of the model, and the sensor's clock (taken modulo 2**24).

        Return the monotonic time right after its last byte was handed to the kernel; None without a stream, or if a
        fault or a client that does not read kept it back. Never blocks.
        """
        if len(ranges_mm) != self.sensor.model.beam_count:
            raise ValueError(
                f"{self.sensor.model.model} has {self.sensor.model.beam_count} beams, not {len(ranges_mm)}"
            )
        if self.frozen:
            ranges_mm = self.sensor.latest_mm
        block = self.sensor.scan(ranges_mm, stamp_ms)
        return None if block is None else self._emit(self._spoil(block))

    def publish_status(self, status: str) -> float | None:
        """Send a block without a scan, as an unstable ("0M") or broken ("0L") sensor does in a stream."""
        block = self.sensor.status_block(status)
        return None if block is None else self._emit(block)

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
        """Hold scans back until `release`, as a congested network or a busy computer does."""
        self._held = self._held or deque(maxlen=_HELD_SCANS)

    def release(self) -> float | None:
        """Deliver the withheld scans in one burst."""
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
        if self._port is not None:
            self._port.close()
            self._port = None
            self._late.clear()
        self.sensor.forget_client()

    def _on_gone(self) -> None:
        self.disconnect()
        self.unplug()

    def _on_bytes(self, chunk: bytes) -> None:
        if self._serial is not None:
            self._serial.allow_reopening()
            if self.baud is not None and self.baud != self._serial.baud():
                return
        if self.silence:
            return
        for reply in self.sensor.feed(chunk):
            self._send(reply)
        if self._rebooting:
            self._rebooting = False
            self.counts["reboot"] += 1
            self.disconnect()
            self.replug()

    def _reboot(self) -> None:
        self._rebooting = True

    def _spoil(self, block: bytes) -> bytes:
        self.counts["published"] += 1
        number = self.counts["published"]
        if self.bad_checksum_every and number % self.bad_checksum_every == 0:
            at = len(block) // 2
            at += block[at] == 0x0A
            block = block[:at] + bytes([block[at] ^ 1]) + block[at + 1 :]
        if self.garbage_every and number % self.garbage_every == 0:
            block = self._random.randbytes(_GARBAGE_BYTES) + block
        return block

    def _emit(self, block: bytes) -> float | None:
        if self._held is not None:
            self._held.append(block)
            return None
        return self._send(block, may_wait=False)

    def _send(self, data: bytes, *, may_wait: bool = True) -> float | None:
        if self._port is None or self.silence:
            return None
        if self._port.busy and not may_wait:
            self.counts["dropped"] += 1
            return None
        if self.late_s or self._late:
            self._late.append((self._clock() + self.late_s, data))
            asyncio.get_running_loop().call_later(self.late_s, self._send_late)
            return None
        return self._clock() if self._port.send(data, spread_s=self.dribble_s) else None

    def _send_late(self) -> None:
        while self._late and self._late[0][0] <= self._clock() + 1e-6 and self._port is not None:
            self._port.send(self._late.popleft()[1], spread_s=self.dribble_s)
