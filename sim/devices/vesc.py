"""Emulated VESC on a pseudo-terminal: real bytes, real unplugging; everything but the motor.

The simulator of the motor reads `demand(now_s)` and calls `report(...)`.
"""

import asyncio
import os
import random
import struct
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from wallride.drivers.api import Clock
from wallride.drivers.vesc import codec
from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet
from wallride.drivers.vesc.replies import STATUS_KILLED, STATUS_TIMED_OUT
from wallride.sim.devices.scip_port import SerialDoor
from wallride.sim.devices.vesc_logic import MotorDemand, VescLogic
from wallride.sim.devices.vesc_replies import (
    CONTROLLER_ID,
    EmulatedAppConfig,
    Value,
    Version,
    firmware_reply,
    imu_reply,
    selective_reply,
    values_reply,
)

__all__ = ["MotorDemand", "VescEmulator"]

_READ_BYTES = 4096
_NOISE_SEED = 7


class VescEmulator:
    """Emulates the motor controller at the other end of the USB cable.

    link: where the port appears, a symbolic link that keeps its name when a replug gives another terminal.
    on_command: called with the time and the new demand after every motor command that is obeyed.
    wire: received payloads with their arrival times, oldest first, bounded.
    servo: position 0..1; 0.5 at power-up and then kept for ever, through timeouts, faults and lost links.

    Faults, each a switch: `silent` (reads, never answers), `garbage` (answers with random bytes, like a lidar of the
    same USB id), `noise` (random bytes around every answer), `bad_crc`, `dribble` (one byte per write), `deaf` (stops
    reading). `kill_switch`, `inject_fault(code)` and `reboot()` are faults of the controller rather than the line.
    So are implausible reports: `shown_erpm` (this, whatever the motor does), `backwards` (speed and counter have
    the wrong sign), `counter_stopped`, `abs_backwards` (the absolute counter runs down). `phases_swapped`: the wheels
    turn the other way, and the controller, which cannot detect it, reports the requested direction.

    config: its application configuration, which it takes and keeps; of it the emulator obeys timeout and brake current.
    """

    def __init__(
        self,
        link: Path,
        *,
        firmware: Version = (6, 5),
        clock: Clock = time.monotonic,
        timeout_s: float = 1.0,
        timeout_brake_a: float = 0.0,
        min_erpm: float = 900.0,
        on_command: Callable[[float, MotorDemand], None] | None = None,
        remember: int = 10_000,
    ) -> None:
        self.link = link
        self.firmware = firmware
        self.hardware_kind = 0
        self.wire: deque[tuple[float, bytes]] = deque(maxlen=remember)
        self.imu: tuple[float, ...] = (0.0,) * 16
        self.silent = self.garbage = self.noise = self.bad_crc = self.dribble = False
        self._clock = clock
        self._on_command = on_command
        self.config = EmulatedAppConfig(timeout_s, timeout_brake_a)
        self._min_erpm = min_erpm
        self._random = random.Random(_NOISE_SEED)
        self.shown_erpm: int | None = None
        self.backwards = self.counter_stopped = self.abs_backwards = self.phases_swapped = False
        self._values: dict[str, Value] = {}
        self._turned = self._counted = self._counted_abs = 0
        self._to_dribble = bytearray()
        self._deaf = False
        self._door = SerialDoor(link)
        self._master: int | None = None
        self._power_up()

    def start(self) -> None:
        """Plug the controller in; needs a running event loop."""
        self._loop = asyncio.get_running_loop()
        self._master = self._door.plug()
        self._deframer = codec.VescDeframer()
        if not self._deaf:
            self._loop.add_reader(self._master, self._on_readable)

    def unplug(self) -> None:
        """Pull the cable: the host's reads and writes fail and the port's name is gone. The VESC stays powered."""
        if self._master is None:
            return
        self._loop.remove_reader(self._master)
        self._door.unplug()
        self._master = None

    def replug(self) -> None:
        """Put the cable back, on what may be another terminal with the same link."""
        self.unplug()
        self.start()

    def close(self) -> None:
        """Unplug for good; idempotent."""
        self.unplug()

    def fileno(self) -> int:
        """Return the descriptor of its end of the cable; ConnectionError while unplugged."""
        if self._master is None:
            raise ConnectionError(f"{self.link}: unplugged")
        return self._master

    def reboot(self) -> None:
        """Lose power for a moment: counters restart at 0, the servo jumps to the middle; the cable stays."""
        self._power_up()

    @property
    def deaf(self) -> bool:
        """Return whether it has stopped reading, so that the host's writes pile up."""
        return self._deaf

    @deaf.setter
    def deaf(self, deaf: bool) -> None:
        self._deaf = deaf
        if self._master is not None:
            self._loop.remove_reader(self._master)
            if not deaf:
                self._loop.add_reader(self._master, self._on_readable)

    @property
    def kill_switch(self) -> bool:
        """Return whether the kill switch input is on."""
        return self._logic.killed

    @kill_switch.setter
    def kill_switch(self, on: bool) -> None:
        self._logic.killed = on

    def inject_fault(self, code: int, fault_stop_s: float = 0.5) -> None:
        """Inject a fault now: output off, code shown and commands ignored for `fault_stop_s`."""
        self._logic.fault_stop_s = fault_stop_s
        self._logic.fault(code, self._clock())

    def demand(self, now_s: float) -> MotorDemand:
        """Return the present demand on the motor, after timeout, fault and kill switch."""
        demand = self._logic.demand(now_s)
        if self.phases_swapped and demand.kind in {"speed", "current", "duty"}:
            return MotorDemand(demand.kind, -demand.value)
        return demand

    def motor_wire(self) -> list[bytes]:
        """Return the received motor commands, oldest first."""
        return [payload for _, payload in self.wire if payload[0] in MOTOR_PACKETS]

    def report(self, erpm: float = 0.0, tachometer: int = 0, voltage_v: float = 11.8, **others: Value) -> None:
        """Set the values of GET_VALUES; others: names of `wallride.drivers.vesc.replies.VALUE_FIELDS`.

        tachometer: steps since the simulation began; what the wire carries starts at 0 with every reboot.
        """
        turned, self._turned = tachometer - self._turned, tachometer
        sign = -1 if self.backwards != self.phases_swapped else 1
        if not self.counter_stopped:
            self._counted += sign * turned
            self._counted_abs += -abs(turned) if self.abs_backwards else abs(turned)
        self._values = {
            "mosfet_temperature_c": 31.5,
            "mosfet_temperatures_c": 31.5,
            "motor_temperature_c": 28.0,
            "controller_id": CONTROLLER_ID,
            **others,
            "erpm": sign * erpm,
            "voltage_v": voltage_v,
            "tachometer": self._counted,
            "tachometer_abs": self._counted_abs,
        }

    def _power_up(self) -> None:
        self.servo = 0.5
        self._counted = self._counted_abs = 0
        self._logic = VescLogic(
            self._clock(), timeout_s=self.config.timeout_s, timeout_brake_a=self.config.timeout_brake_a,
            min_erpm=self._min_erpm,
        )  # fmt: skip
        self.report(tachometer=self._turned)

    def _on_readable(self) -> None:
        assert self._master is not None, "the reader is removed before the terminal is closed"  # noqa: S101
        self._door.allow_reopening()
        for payload in self._deframer.feed(os.read(self._master, _READ_BYTES)):
            self._on_payload(payload)

    def _on_payload(self, payload: bytes) -> None:
        now_s = self._clock()
        self.wire.append((now_s, payload))
        if self._logic.command(payload, now_s) and self._on_command is not None:
            self._on_command(now_s, self.demand(now_s))
        if payload[0] == Packet.SET_SERVO_POS and len(payload) >= 3:
            self.servo = min(max(struct.unpack_from(">h", payload, 1)[0] / 1000, 0.0), 1.0)
        reply = self._answer(payload, now_s)
        if reply is not None and not self.silent:
            self.transmit(reply)

    def _answer(self, request: bytes, now_s: float) -> bytes | None:
        match request[0]:
            case Packet.FW_VERSION:
                return firmware_reply(self.firmware, kind=self.hardware_kind)
            case Packet.GET_VALUES:
                return values_reply(self.firmware, self._values_now(now_s))
            case Packet.GET_VALUES_SELECTIVE:
                return selective_reply(request, self._values_now(now_s))
            case Packet.GET_IMU_DATA:
                return imu_reply(self.firmware, request, self.imu, CONTROLLER_ID)
            case Packet.GET_APPCONF:
                return self.config.told(self.firmware)
            case Packet.SET_APPCONF:
                return self._take_config(request)
            case _:  # setters are never acknowledged, unknown requests never answered
                return None

    def _take_config(self, request: bytes) -> bytes | None:
        reply = self.config.take(self.firmware, request)
        self._logic.timeout_s, self._logic.timeout_brake_a = self.config.timeout_s, self.config.timeout_brake_a
        if self.config.fault in {"cut before", "cut after"}:
            self._loop.call_soon(self.unplug)
            return None
        return reply

    def _values_now(self, now_s: float) -> dict[str, Value]:
        logic = self._logic
        status = STATUS_TIMED_OUT * logic.timed_out(now_s) | STATUS_KILLED * logic.killed
        shown = {} if self.shown_erpm is None else {"erpm": self.shown_erpm}
        return {**self._values, **shown, "fault_code": logic.fault_code(now_s), "status": status}

    def transmit(self, payload: bytes) -> None:
        """Send a packet to the host, with the injected troubles of the line."""
        data = codec.frame(payload)
        if self.bad_crc:
            data = data[:-3] + bytes((data[-3] ^ 1,)) + data[-2:]
        if self.garbage:
            data = self._random.randbytes(len(data))
        if self.noise:
            data = self._random.randbytes(9) + data + self._random.randbytes(9)
        if not self.dribble:
            self.write(data)
            return
        was_dribbling = bool(self._to_dribble)
        self._to_dribble += data
        if not was_dribbling:
            self._loop.call_soon(self._dribble_on)

    def _dribble_on(self) -> None:
        """Write one byte per iteration of the loop, so that a host in the same loop reads in between."""
        self.write(bytes(self._to_dribble[:1]))
        del self._to_dribble[:1]
        if self._to_dribble:
            self._loop.call_soon(self._dribble_on)

    def write(self, data: bytes) -> None:
        """Write raw bytes to the host; dropped while unplugged, or when the host does not read."""
        if self._master is None:
            return
        try:
            os.write(self._master, data)
        except BlockingIOError:  # the host does not read: after 100 ms a VESC drops the reply, too
            return
