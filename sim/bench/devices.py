"""Lidar and motor controller of a benchmark: one thread, blocking, no event loop between a byte and its time.

Their state machines are those of the emulators in `wallride.sim.devices`; only the input and output path is shorter.
"""

import contextlib
import select
import socket
import time
from dataclasses import dataclass, field
from typing import Final

from wallride.drivers.vesc import codec
from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.bench.course import Picture
from wallride.sim.devices.scip_encode import SensorModel
from wallride.sim.devices.scip_sensor import ScipSensor
from wallride.sim.devices.vesc_replies import firmware_reply, values_reply

READ_BYTES: Final = 4096
FIRMWARE: Final = (6, 5)
_GAIN: Final = VescSettings().speed_to_erpm_gain


@dataclass(frozen=True, slots=True)
class MotorCommand:
    """A motor command and the servo position that came with it.

    at_s: when its first byte could be read. moving: whether it requests a speed. servo: thousandths, -1 when none came.
    """

    at_s: float
    moving: bool
    servo: int


class BenchTcpPort:
    """TCP port of this machine. address: in the form of the car's settings."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._client: socket.socket | None = None
        self.address = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    @property
    def fd(self) -> int:
        """Return the descriptor to wait on."""
        return (self._client or self._listener).fileno()

    def read(self) -> bytes | None:
        """Return the client's bytes, b"" when it has left, None when it has only just connected."""
        if self._client is None:
            self._client, _ = self._listener.accept()
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return None
        try:
            chunk = self._client.recv(READ_BYTES)
        except ConnectionError:
            chunk = b""
        if not chunk:
            self._client.close()
            self._client = None
        return chunk

    def write(self, data: bytes) -> None:
        """Write to the client; returns when the kernel has all of it."""
        if self._client is not None:
            with contextlib.suppress(ConnectionError):  # the car has gone; the measurement will notice
                self._client.sendall(data)

    def close(self) -> None:
        """Close all descriptors."""
        self._listener.close()
        if self._client is not None:
            self._client.close()


class LidarPort(BenchTcpPort):
    """Lidar port; one client. settings: the car's, as `--set` takes them."""

    def __init__(self, model: SensorModel) -> None:
        super().__init__()
        self._sensor = ScipSensor(model, time.monotonic, lambda: None)
        self._served = False
        self.settings: tuple[str, ...] = (f"lidar.address={self.address}",)

    @property
    def streaming(self) -> bool:
        """Return whether scans were requested."""
        return self._served and self._sensor.measurement is not None

    def on_readable(self) -> None:
        """Accept a client, or process its bytes."""
        chunk = self.read()
        self._served = chunk != b""
        if chunk:
            for reply in self._sensor.feed(chunk):
                self.write(reply)
        elif chunk == b"":
            self._sensor.forget_client()

    def block(self, picture: Picture, stamp_ms: int) -> bytes:
        """Return the block for `send`."""
        return picture.block(self._sensor.measurement.echo if self._sensor.measurement else b"", stamp_ms)

    def send(self, block: bytes) -> None:
        """Send a scan; returns when the kernel has all of it."""
        self.write(block)


@dataclass(slots=True)
class _Wheels:
    """State that the controller reports."""

    speed_mps: float = 0.0
    distance_m: float = 0.0
    since_s: float = field(default_factory=time.monotonic)

    def turn(self, speed_mps: float) -> None:
        """Continue at another speed."""
        now_s = time.monotonic()
        self.distance_m += self.speed_mps * (now_s - self.since_s)
        self.speed_mps, self.since_s = speed_mps, now_s


class MotorPort(BenchTcpPort):
    """VESC port. commands: all received ones, oldest first."""

    def __init__(self) -> None:
        super().__init__()
        self.wheels = _Wheels()
        self.commands: list[MotorCommand] = []
        self._deframer = codec.VescDeframer()
        self._pending: tuple[float, bool] | None = None

    def on_readable(self, at_s: float) -> None:
        """Process commands, answer requests. at_s: when there was something to read."""
        for payload in self._deframer.feed(self.read() or b""):
            self._on_payload(payload, at_s)

    def _on_payload(self, payload: bytes, at_s: float) -> None:
        packet = payload[0]
        if packet in MOTOR_PACKETS:
            self._flush()
            self._pending = (at_s, packet == Packet.SET_RPM and payload[1:5] != bytes(4))
        elif packet == Packet.SET_SERVO_POS and self._pending is not None:
            self.commands.append(MotorCommand(*self._pending, int.from_bytes(payload[1:3], "big")))
            self._pending = None
        elif packet == Packet.GET_VALUES:
            wheels = self.wheels
            values = {
                "voltage_v": 11.8,
                "erpm": round(wheels.speed_mps * _GAIN),
                "tachometer": round(wheels.distance_m * _GAIN / 10),
            }
            self.write(codec.frame(values_reply(FIRMWARE, values)))
        elif packet == Packet.FW_VERSION:
            self.write(codec.frame(firmware_reply(FIRMWARE)))

    def _flush(self) -> None:
        if self._pending is not None:
            self.commands.append(MotorCommand(*self._pending, -1))
            self._pending = None


@dataclass(slots=True)
class Ports:
    """Both ports, served by one thread."""

    lidar: LidarPort
    motor: MotorPort

    def serve_until(self, deadline_s: float) -> None:
        """Answer requests until a time (monotonic)."""
        while (left_s := deadline_s - time.monotonic()) > 0:
            self.serve_once(left_s)

    def serve_once(self, timeout_s: float) -> None:
        """Wait for a request, up to a timeout."""
        ready, _, _ = select.select((self.motor.fd, self.lidar.fd), (), (), timeout_s)
        at_s = time.monotonic()
        if self.motor.fd in ready:
            self.motor.on_readable(at_s)
        if self.lidar.fd in ready:
            self.lidar.on_readable()
