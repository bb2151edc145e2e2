"""State machine of a Hokuyo: its states and replies, without port or clock of its own.

States: standby, measuring (a stream is on), time-sync; and a SCIP 1.1 sensor before SCIP2.0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock
from wallride.sim.devices.scip_encode import (
    STAMP_WRAP_MS,
    SensorModel,
    cluster_minimum,
    encode_block,
    encode_fields,
    encode_number,
    encode_samples,
    encode_scan,
)

_REBOOT_WINDOW_S: Final = 1.0
_COMMAND_LIMIT_CHARS: Final = 64
_INTENSITY: Final = 2000


@dataclass(slots=True)
class Measurement:
    """A request for scans. `remaining` is None for an endless stream; `due` counts down the scans to skip."""

    echo: bytes
    family: str
    first_step: int
    last_step: int
    cluster: int
    skip: int = 0
    remaining: int | None = None
    due: int = 0


class ScipSensor:
    """State machine of the sensor: command bytes in, reply bytes out; scans on request.

    fault: a status ("0L", "50") with which it answers every measurement until one of `cured_by` (RS, RB) is sent.
    scip1: it boots in SCIP 1.1 and answers "E" until SCIP2.0.
    unanswered: commands that it does not answer. refused: those that it does not know. damaged: those whose replies
        have a wrong sum.
    ahead_ms: its counter less the clock. The counter goes by the stamps of the published scans, except that the first
        scan goes on from a counter that was told before it.
    """

    def __init__(self, model: SensorModel, clock: Clock, reboot: Callable[[], None]) -> None:
        self.model = model
        self.fault = ""
        self.cured_by = frozenset({"RS", "RB"})
        self.scip1 = False
        self.unanswered: frozenset[str] = frozenset()
        self.refused: frozenset[str] = frozenset()
        self.damaged: frozenset[str] = frozenset()
        self.ahead_ms = 0.0
        self.measurement: Measurement | None = None
        self.laser_on = False
        self.in_time_sync = False
        self.state_text = "sensor is working normally"
        self.latest_mm: npt.NDArray[np.integer] = np.full(model.beam_count, 65533)
        self.latest_ms = 0
        self._clock = clock
        self._reboot = reboot
        self._line = bytearray()
        self._reboot_asked_s: float | None = None
        self._has_told = self._has_scanned = False
        self._shift_ms = 0

    def feed(self, chunk: bytes) -> list[bytes]:
        """Process bytes of commands, ended by CR, LF or both, and return the replies."""
        replies = []
        for byte in chunk:
            if byte not in b"\r\n":
                self._line.append(byte)
                del self._line[_COMMAND_LIMIT_CHARS:]
            elif self._line:
                replies.append(self.answer(bytes(self._line)))
                self._line.clear()
        return replies

    def forget_client(self) -> None:
        """Reset after the end of the connection: no stream, no partial command."""
        self.measurement = None
        self.laser_on = self.in_time_sync = False
        self._line.clear()

    def jump(self, ms: int) -> None:
        """Let the stamps of all further scans jump, and the counter with them."""
        self._shift_ms += ms

    def answer(self, echo: bytes) -> bytes:
        """Return the reply to one command line."""
        text = echo.decode("ascii", "replace").partition(";")[0]
        if text in self.unanswered:
            return b""
        reply = self._answer(text, echo)
        return reply[:-3] + bytes([reply[-3] ^ 1]) + b"\n\n" if text in self.damaged else reply

    def _answer(self, text: str, echo: bytes) -> bytes:
        if text in self.refused:
            return encode_block(echo, "0E")
        if self.scip1 and text != "SCIP2.0":
            return encode_block(echo, "E")
        if self.in_time_sync and text not in {"TM0", "TM1", "TM2"}:
            return encode_block(echo, "0E")
        if text in {"VV", "PP", "II", "%ST"}:
            return self._describe(text, echo)
        if text[:2] in {"MD", "MS", "ME", "GD", "GS", "GE"}:
            return self._measure(text, echo)
        return self._switch(text, echo)

    def _describe(self, text: str, echo: bytes) -> bytes:
        if text == "%ST":
            state = "900" if self.fault else "004" if self.measurement else "003" if self.laser_on else "000"
            return encode_block(echo, "00", [state.encode("ascii")])
        if text == "VV":
            return encode_fields(echo, self.model.version())
        if text == "PP":
            return encode_fields(echo, self.model.parameters())
        state_fields = {
            "MODL": self.model.model,
            "LASR": "ON" if self.laser_on else "OFF",
            "SCSP": f"{self.model.speed_rpm}[rpm]",
            "MESM": "Measuring" if self.measurement else "IDLE",
            "SBPS": "115200[bps]" if self.model.serial_port else "Ethernet 100 [Mbps]",
            "TIME": f"{self._now_ms():06X}",
            "STAT": self.state_text,
        }
        return encode_fields(echo, state_fields)

    def _switch(self, text: str, echo: bytes) -> bytes:
        match text:
            case "SCIP2.0":
                self.scip1 = False
                return encode_block(echo, "00")
            case "QT":
                self.forget_client()
                return encode_block(echo, "00")
            case "RS" | "RT":
                return self._reset(text, echo)
            case "RB":
                return self._answer_reboot(echo)
            case "BM":
                already, self.laser_on = self.laser_on, not self.fault
                return encode_block(echo, "01" if self.fault else "02" if already else "00")
            case "TM0" | "TM2":
                entering = text == "TM0"
                status = ("02" if entering else "03") if entering is self.in_time_sync else "00"
                self.in_time_sync = entering
                return encode_block(echo, status)
            case "TM1" if self.in_time_sync:
                self._has_told = True
                return encode_block(echo, "00", [encode_number(self._now_ms(), 4)])
            case "TM1":
                return encode_block(echo, "04")
            case _ if text.startswith("SS") and self.model.serial_port:
                return encode_block(echo, "00" if text[2:].isdecimal() else "01")
        return encode_block(echo, "0E")

    def _reset(self, text: str, echo: bytes) -> bytes:
        if self.fault and text not in self.cured_by:
            return encode_block(echo, "0L")
        self.fault = ""
        self.forget_client()
        return encode_block(echo, "00")

    def _answer_reboot(self, echo: bytes) -> bytes:
        now_s, asked_s = self._clock(), self._reboot_asked_s
        self._reboot_asked_s = now_s
        if asked_s is None or now_s - asked_s > _REBOOT_WINDOW_S:
            return encode_block(echo, "01")
        if "RB" in self.cured_by:
            self.fault = ""
        self._reboot_asked_s = None
        self._reboot()
        return encode_block(echo, "00")

    def _measure(self, text: str, echo: bytes) -> bytes:
        request = self._read_request(text, echo)
        if isinstance(request, str):
            return encode_block(echo, request)
        if self.fault:
            return encode_block(echo, self.fault)
        if text.startswith("M"):
            self.laser_on = True
            self.measurement = request
            return encode_block(echo, "00")
        if not self.laser_on:
            return encode_block(echo, "10")
        return self._encode(request, "00", self.latest_mm, self.latest_ms)

    def _read_request(self, text: str, echo: bytes) -> Measurement | str:
        streamed = text.startswith("M")
        digits = text[2:]
        if text[1] == "E" and not self.model.intensities:
            return "0E"
        if len(digits) != (13 if streamed else 10):
            return "0C"
        parts = [digits[:4], digits[4:8], digits[8:10], digits[10:11] or "0", digits[11:] or "0"]
        for part, status in zip(parts, ("01", "02", "03", "06", "07"), strict=True):
            if not part.isdecimal():
                return status
        first_step, last_step, cluster, skip, scans = map(int, parts)
        if last_step > self.model.last_step or first_step < self.model.first_step:
            return "04"
        if last_step < first_step:
            return "05"
        return Measurement(echo, text[:2], first_step, last_step, cluster, skip, scans or None)

    def scan(self, ranges_mm: npt.NDArray[np.integer], stamp_ms: int) -> bytes | None:
        """Return the block for one revolution (ranges of all steps), or None when this one was not requested."""
        stamp_ms = self._counted_ms(stamp_ms)
        self.latest_mm, self.latest_ms = ranges_mm, stamp_ms
        request = self.measurement
        if request is None:
            return None
        if request.due:
            request.due -= 1
            return None
        request.due = request.skip
        if request.remaining is not None:
            request.remaining -= 1
            if request.remaining == 0:
                self.measurement = None
        return self._encode(request, "99", ranges_mm, stamp_ms)

    def status_block(self, status: str) -> bytes | None:
        """Return the block that replaces a scan when there is none ("0M", "0L"); None while not streaming."""
        return encode_block(self._scan_echo(self.measurement), status) if self.measurement else None

    def _encode(self, request: Measurement, status: str, ranges_mm: npt.NDArray[np.integer], stamp_ms: int) -> bytes:
        offset = self.model.first_step
        wanted = ranges_mm[request.first_step - offset : request.last_step - offset + 1]
        values = cluster_minimum(wanted, request.cluster)
        if request.family.endswith("S"):
            samples = encode_samples(np.minimum(values, 4095), 2)
        elif request.family.endswith("E"):
            samples = encode_samples(np.stack([values, np.full_like(values, _INTENSITY)], axis=1), 3)
        else:
            samples = encode_samples(values, 3)
        return encode_scan(self._scan_echo(request), status, stamp_ms, samples)

    def _scan_echo(self, request: Measurement) -> bytes:
        if request.remaining is None:
            return request.echo
        head, semicolon, note = request.echo.partition(b";")
        return head[:-2] + f"{request.remaining:02d}".encode("ascii") + semicolon + note

    def _counted_ms(self, stamp_ms: int) -> int:
        """Return the stamp of a scan that is complete now: the counter's value at its first step."""
        now_ms = self._clock() * 1000
        sweep_ms = 1000 * self.model.period_s * self.model.beam_count / self.model.steps_per_turn
        if self._has_told and not self._has_scanned:
            self._shift_ms = round(now_ms + self.ahead_ms - sweep_ms) - stamp_ms
        self._has_scanned = True
        stamp_ms += self._shift_ms
        self.ahead_ms = stamp_ms + sweep_ms - now_ms
        return stamp_ms

    def _now_ms(self) -> int:
        return int(self._clock() * 1000 + self.ahead_ms) % STAMP_WRAP_MS
