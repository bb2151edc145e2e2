"""Command logic of a VESC: its timeout, its faults, its dead band. Pure; time is an argument.

Sources: vedderb/bldc `timeout.c`, `motor/mc_interface.c` (fault stop), `motor/foc_math.c` (speed loop).
"""

import struct
from dataclasses import dataclass
from typing import Literal

from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet

FAULT_STOP_S = 0.5
NO_BRAKE_UNDER_A = 0.05
MOTOR_CURRENT_MAX_A = 60.0


@dataclass(frozen=True, slots=True)
class MotorDemand:
    """Demand on the power stage: ERPM for "speed", A for "brake" and "current", -1..1 for "duty".

    The ramp of the speed loop (25000 ERPM/s) is left to the simulator of the motor.
    """

    kind: Literal["speed", "brake", "current", "coast", "duty"]
    value: float


COAST = MotorDemand("coast", 0.0)


class VescLogic:
    """Converts motor commands into a demand.

    timeout_s: 0 disables the command timeout, as in the firmware.
    killed: the kill switch input, which releases the motor while it is on.
    """

    def __init__(self, now_s: float, *, timeout_s: float, timeout_brake_a: float, min_erpm: float) -> None:
        self.timeout_s = timeout_s
        self.timeout_brake_a = timeout_brake_a
        self.min_erpm = min_erpm
        self.fault_stop_s = FAULT_STOP_S
        self.killed = False
        self._commanded = COAST
        self._fed_s = now_s
        self._fault_code = 0
        self._fault_until_s = now_s

    def command(self, payload: bytes, now_s: float) -> bool:
        """Process a request; True when it was a motor command and is obeyed."""
        if payload[0] == Packet.ALIVE:
            self._fed_s = now_s
        if payload[0] not in MOTOR_PACKETS or len(payload) < 5:
            return False
        self._fed_s = now_s
        if self.fault_code(now_s):
            return False
        self._commanded = self._read(payload)
        return True

    def fault(self, code: int, now_s: float) -> None:
        """Stop the output and ignore commands for a while; the next command after that is obeyed."""
        self._fault_code = code
        self._fault_until_s = now_s + self.fault_stop_s
        self._commanded = COAST

    def fault_code(self, now_s: float) -> int:
        """Return the fault shown now: only as long as commands are ignored for it."""
        return self._fault_code if now_s < self._fault_until_s else 0

    def timed_out(self, now_s: float) -> bool:
        """Return whether the last motor command or ALIVE is too old."""
        return self.timeout_s > 0 and now_s - self._fed_s > self.timeout_s

    def demand(self, now_s: float) -> MotorDemand:
        """Return the present demand on the motor."""
        if self.killed or self.fault_code(now_s):
            return COAST
        if self.timed_out(now_s):
            return _brake(self.timeout_brake_a)
        return self._commanded

    def _read(self, payload: bytes) -> MotorDemand:
        (raw,) = struct.unpack_from(">i", payload, 1)
        match payload[0]:
            case Packet.SET_RPM:
                return MotorDemand("speed", float(raw)) if abs(raw) >= self.min_erpm else COAST
            case Packet.SET_CURRENT_BRAKE | Packet.SET_HANDBRAKE:
                return _brake(raw / 1000)
            case Packet.SET_CURRENT:
                return MotorDemand("current", raw / 1000) if raw else COAST
            case Packet.SET_CURRENT_REL:
                return MotorDemand("current", raw / 100_000 * MOTOR_CURRENT_MAX_A) if raw else COAST
            case Packet.SET_DUTY:
                return MotorDemand("duty", raw / 100_000)
            case _:  # SET_POS: a car has no position control
                return COAST


def _brake(current_a: float) -> MotorDemand:
    return MotorDemand("brake", current_a) if abs(current_a) >= NO_BRAKE_UNDER_A else COAST
