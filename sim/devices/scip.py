"""Emulated Hokuyo lidar: real SCIP bytes over TCP or a pseudo-terminal, with every known fault to inject.

The protocol state is in `scip_sensor`, the encoding in `scip_encode`, the port in `sensor_port`; this is the device.
"""

import time
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock
from wallride.sim.devices.scip_encode import UST_10LX, SensorModel
from wallride.sim.devices.scip_sensor import ScipSensor
from wallride.sim.devices.sensor_port import SensorPort


class ScipEmulator(SensorPort):
    """Emulates one sensor with one client. Its owner calls `publish` once per revolution, and `close` at the end.

    Faults to set at any time, besides those of its port (None or False: off):
        frozen: every scan repeats the ranges of the last one before, with stamps that go on.
        sensor: its `fault`, `scip1`, `state_text`, `model` and others may be changed; see ScipSensor.
    counts: those of `SensorPort`, "reboot".
    """

    held_frames: ClassVar = 400
    garbage_bytes: ClassVar = 200

    def __init__(self, model: SensorModel = UST_10LX, *, clock: Clock = time.monotonic, seed: int = 1) -> None:
        super().__init__(clock, seed)
        self.sensor = ScipSensor(model, clock, self._reboot)
        self.frozen = False
        self._rebooting = False

    @property
    def streaming(self) -> bool:
        """Return whether a client requested scans and is still connected."""
        return self._port is not None and self.sensor.measurement is not None

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

    def _answers(self, chunk: bytes) -> list[bytes]:
        return self.sensor.feed(chunk)

    def _forget_client(self) -> None:
        self.sensor.forget_client()

    def _on_bytes(self, chunk: bytes) -> None:
        super()._on_bytes(chunk)
        if self._rebooting:
            self._rebooting = False
            self.counts["reboot"] += 1
            self.disconnect()
            self.replug()

    def _reboot(self) -> None:
        self._rebooting = True
