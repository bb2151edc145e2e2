"""Port of an emulated lidar: one client over TCP or a pseudo-terminal, with the faults of cables and networks."""

import asyncio
import random
from abc import ABC, abstractmethod
from collections import Counter, deque
from pathlib import Path
from typing import ClassVar

from wallride.drivers.api import Clock
from wallride.sim.devices.scip_port import BytePort, SerialDoor, TcpPort

LINE_FEED = 0x0A


class SensorPort(ABC):
    """Bytes between a sensor and its one client. Its owner calls `close` at the end.

    Faults to set at any time (None or False: off):
        silence: connections are accepted, commands and scans go nowhere (a pulled cable).
        bad_checksum_every: every n-th frame has one byte changed.
        garbage_every: random bytes before every n-th frame.
        late_s: all bytes leave so much later, in order (a slow network).
        dribble_s: bytes leave one by one, a frame takes about this long.
        baud: a serial client at another speed hears nothing.
    counts: "published", "dropped" (the client did not read), "client".
    """

    held_frames: ClassVar[int]
    """Number of frames that `stall` keeps; the oldest are lost."""
    garbage_bytes: ClassVar[int]

    def __init__(self, clock: Clock, seed: int) -> None:
        self.silence = False
        self.bad_checksum_every: int | None = None
        self.garbage_every: int | None = None
        self.dribble_s: float | None = None
        self.late_s = 0.0
        self.baud: int | None = None
        self.counts: Counter[str] = Counter()
        self._clock = clock
        self._random = random.Random(seed)
        self._port: BytePort | None = None
        self._tcp: TcpPort | None = None
        self._serial: SerialDoor | None = None
        self._held: deque[bytes] | None = None
        self._late: deque[tuple[float, bytes]] = deque()  # when each leaves

    @abstractmethod
    def _answers(self, chunk: bytes) -> list[bytes]:
        """Process bytes of commands and return the replies."""

    def _power_on(self) -> None:  # noqa: B027 - SCIP has nothing to begin
        """Begin as after power-on; the client is gone already."""

    def _forget_client(self) -> None:  # noqa: B027 - as its docstring says
        """Process that the client has gone. A sensor on a serial line does not notice."""

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
        """Hold frames back until `release`, as a congested network or a busy computer does."""
        self._held = self._held or deque(maxlen=self.held_frames)

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
            self._power_on()
            self._welcome(self._serial.plug())

    def close(self) -> None:
        """Close all descriptors."""
        self.refuse()
        self.disconnect()
        self.unplug()

    def _emit(self, frame: bytes) -> float | None:
        """Send a frame, unless it is held back or the client does not read; see `_send`."""
        if self._held is not None:
            self._held.append(frame)
            return None
        return self._send(frame, may_wait=False)

    def _spoil(self, frame: bytes) -> bytes:
        self.counts["published"] += 1
        number = self.counts["published"]
        if self.bad_checksum_every and number % self.bad_checksum_every == 0:
            at = len(frame) // 2
            at += frame[at] == LINE_FEED  # SCIP's checksums do not cover line feeds
            frame = frame[:at] + bytes([frame[at] ^ 1]) + frame[at + 1 :]
        if self.garbage_every and number % self.garbage_every == 0:
            frame = self._random.randbytes(self.garbage_bytes) + frame
        return frame

    def _welcome(self, fd: int) -> None:
        self._farewell()
        self.counts["client"] += 1
        self._port = BytePort(fd, self._on_bytes, self._on_gone)

    def _farewell(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
            self._late.clear()
        self._forget_client()

    def _on_gone(self) -> None:
        self.disconnect()
        self.unplug()

    def _on_bytes(self, chunk: bytes) -> None:
        if self._serial is not None:
            self._serial.allow_reopening()
        if self._is_heard():
            for reply in self._answers(chunk):
                self._send(reply)

    def _is_heard(self) -> bool:
        if self.silence:
            return False
        return self._serial is None or self.baud is None or self._serial.baud() == self.baud

    def _send(self, data: bytes, *, may_wait: bool = True) -> float | None:
        """Send bytes; return the monotonic time right after the last was handed to the kernel, None where none was."""
        if self._port is None or not self._is_heard():
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
