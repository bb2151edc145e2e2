"""Direction, brake and timeout by measurement, with the wheels in the air: the only check that moves anything."""

import asyncio
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wallride.doctor.findings import Finding, Level, fail, ok, warn
from wallride.doctor.motor_config import SET_TIMEOUT, judge_timeout
from wallride.drivers.api import Drive, MotorState
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.ending import end
from wallride.runtime.wire.mailbox import call_in_loop

Ask = Callable[[str], bool | None]
"""Asks a question; None without an answer."""

SPEED_MPS: Final = 0.7
SPIN_UP_S: Final = 1.5
SEND_S: Final = 0.02
STOPS_WITHIN_S: Final = 3.0
CONNECT_S: Final = 7.0
STEER_RAD: Final = 0.2
STEER_S: Final = 1.0
TURNING_MPS: Final = 0.3
STANDING_MPS: Final = 0.1
MIN_TIMEOUT_BRAKE_MPS2: Final = 1.0
"""Deceleration after the timeout from which it counts as braked; free wheels coast with less."""
SLOWER_MPS: Final = 0.05
"""Loss of speed that shows the timeout of a firmware that does not report it."""


@dataclass(slots=True)
class Spin:
    """One measurement.

    speed_mps, distance_m: while it drove, the highest speed. fault: that ended it. timeout_s, stopped_s: after the last
    command; None: not within STOPS_WITHIN_S.
    """

    speed_mps: float = 0.0
    distance_m: float = 0.0
    fault: str = ""
    timeout_s: float | None = None
    stopped_s: float | None = None

    @property
    def braked_mps2(self) -> float:
        """Deceleration after the timeout, 0 where it did not stop."""
        if self.timeout_s is None or self.stopped_s is None:
            return 0.0
        return abs(self.speed_mps) / max(self.stopped_s - self.timeout_s, SEND_S)


async def measure_wheels_up(settings: VescSettings, ask: Ask) -> list[Finding]:
    """Turn the wheels forward, fall silent, then brake; the questions are about what only a person sees."""
    motor = Vesc(settings, clock=_now_s)
    running = asyncio.create_task(motor.run())
    try:
        await _connected(motor)
        if motor.state is None:
            return [fail("wheels up", motor.health.message, "see `motor`")]
        spin = await _spin(motor)
        found = [await _direction(spin, ask)]
        if found[0].level is not Level.FAIL:  # else nothing is to turn again
            found += [*_after_silence(spin), await _brake(motor), await _steering(motor, ask)]
    finally:
        motor.send(Drive(0.0, 0.0))
        for error in await end(running):
            raise error
    return found


async def _spin(motor: Vesc) -> Spin:
    spin, begin_m = Spin(), _state(motor).distance_m
    spin.speed_mps = await _hold(motor, Drive(SPEED_MPS, 0.0), SPIN_UP_S)
    spin.distance_m, spin.fault = _state(motor).distance_m - begin_m, _state(motor).fault
    silent_s = _now_s()
    while (now_s := _now_s()) - silent_s < STOPS_WITHIN_S and spin.stopped_s is None:
        if (state := motor.state) is not None:
            slower = abs(state.speed_mps) < abs(spin.speed_mps) - SLOWER_MPS
            if spin.timeout_s is None and (state.timed_out or slower):
                spin.timeout_s = now_s - silent_s
            if abs(state.speed_mps) < STANDING_MPS:
                spin.stopped_s = now_s - silent_s
        await asyncio.sleep(SEND_S / 4)
    return spin


async def _direction(spin: Spin, ask: Ask) -> Finding:
    if spin.speed_mps < -TURNING_MPS or spin.distance_m < 0:
        return fail("direction", "asked forward, the VESC counts backward", "invert the motor direction in VESC Tool")
    if spin.fault:
        words, _, remedy = spin.fault.partition(": ")
        return fail("direction", words, remedy or "repeat the motor detection in VESC Tool")
    if spin.speed_mps < TURNING_MPS:
        return fail(
            "direction", f"at {SPEED_MPS:g} m/s asked the wheels turn with {spin.speed_mps:.2f} m/s",
            "repeat the motor detection in VESC Tool; check the motor's cables",
        )  # fmt: skip
    turned = await _asked(ask, "did the wheels turn forward?")
    if turned is None:
        return warn("direction", "the VESC counts forward; the wheels were not looked at", "look at them in a terminal")
    if not turned:
        return fail("direction", "the wheels turn backward", "invert the motor direction in VESC Tool, not in car.toml")
    return ok("direction", f"forward, {spin.speed_mps:.2f} m/s of {SPEED_MPS:g}")


def _after_silence(spin: Spin) -> list[Finding]:
    if spin.timeout_s is None:
        return [fail("timeout measured", f"none within {STOPS_WITHIN_S:g} s of silence", SET_TIMEOUT)]
    timeout = judge_timeout(max(spin.timeout_s, SEND_S))
    found = [Finding("timeout measured", timeout.level, timeout.words, timeout.remedy)]
    if spin.braked_mps2 >= MIN_TIMEOUT_BRAKE_MPS2:
        return [*found, ok("timeout brake measured", f"{spin.braked_mps2:.1f} m/s2")]
    return [*found, fail("timeout brake measured", "after the timeout the wheels coast", SET_TIMEOUT)]


async def _brake(motor: Vesc) -> Finding:
    await _hold(motor, Drive(SPEED_MPS, 0.0), SPIN_UP_S)
    begin_s = _now_s()
    while abs(_state(motor).speed_mps) > STANDING_MPS and _now_s() - begin_s < STOPS_WITHIN_S:
        await _hold(motor, Drive(0.0, 0.0), SEND_S)
    took_s = _now_s() - begin_s
    if abs(_state(motor).speed_mps) > STANDING_MPS:
        return fail("brake", f"the wheels turn {STOPS_WITHIN_S:g} s after a stop", "check the motor detection, and the "
                    "motor's brake current limit in VESC Tool")  # fmt: skip
    return ok("brake", f"the wheels stand after {took_s:.2f} s")


async def _steering(motor: Vesc, ask: Ask) -> Finding:
    for steering_rad in (STEER_RAD, 0.0):
        await _hold(motor, Drive(0.0, steering_rad), STEER_S)
    steered = await _asked(ask, "did the front wheels steer to the left, and back?")
    if steered is None:
        return warn("steering", "the front wheels were not looked at", "look at them in a terminal")
    if not steered:
        return fail(
            "steering", "the front wheels do not steer to the left",
            "enable the servo output in VESC Tool; where they steer right, change the sign of "
            "motor.steering_to_servo_gain",
        )  # fmt: skip
    return ok("steering", "left is left")


async def _asked(ask: Ask, question: str) -> bool | None:
    """Ask in a thread: while a person thinks, the driver has to go on reading, or it loses the link.

    Not in one of the loop's own: Ctrl-C would wait for the answer.
    """
    loop, answered = asyncio.get_running_loop(), asyncio.Event()
    answers: list[bool | None] = []

    def in_thread() -> None:
        try:
            answers.append(ask(question))
        finally:
            call_in_loop(loop, answered.set)

    threading.Thread(target=in_thread, name="question", daemon=True).start()
    await answered.wait()
    return answers[0] if answers else None


async def _hold(motor: Vesc, drive: Drive, duration_s: float) -> float:
    """Send a command for a while; return the reported speed that was farthest from 0."""
    until_s, peak_mps = _now_s() + duration_s, 0.0
    while _now_s() < until_s:
        motor.send(drive)
        await asyncio.sleep(SEND_S)
        peak_mps = max(peak_mps, _state(motor).speed_mps, key=abs)
    return peak_mps


async def _connected(motor: Vesc) -> None:
    for _ in range(round(CONNECT_S / SEND_S)):
        if motor.state is not None:
            return
        await asyncio.sleep(SEND_S)


def _now_s() -> float:
    return asyncio.get_running_loop().time()


def _state(motor: Vesc) -> MotorState:
    """Return the newest report; a standing car where the link is lost in the middle."""
    lost = MotorState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, "", timed_out=False, killed=False)
    return motor.state or lost
