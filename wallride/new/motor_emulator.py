"""The motor controller's side of its protocol, without a port: for the tests of its driver, and for `wallride sim`."""

from wallride.new.motor_driver import line, read

TIMEOUT_S = 0.15
"""Time without a command after which it brakes by itself: what a car needs of its controller."""


class MotorDevice:
    """Takes speeds and brakes, and reports when it is asked."""

    def __init__(self) -> None:
        self.speed_mps: float | None = None
        self.steering_rad = 0.0
        self.commands = 0
        self._heard = b""
        self._commanded_s = 0.0
        self._wheels = (0.0, 0.0)

    def feed(self, data: bytes, now_s: float) -> bytes:
        """Take bytes of the driver, or b"" while none come; return the reports that it asked for."""
        if now_s - self._commanded_s > TIMEOUT_S:
            self.speed_mps = None
        *lines, self._heard = (self._heard + data).split(b"\n")
        return b"".join(self._answer(read(one), now_s) for one in lines)

    def report(self, speed_mps: float, distance_m: float) -> bytes:
        """Note the wheels' motion."""
        self._wheels = speed_mps, distance_m
        return b""

    def _answer(self, words: list[str], now_s: float) -> bytes:
        if words[:1] == ["?"]:
            return line("S", *self._wheels, 11.8)
        if words[:1] in (["D"], ["B"]):
            steering, *speed = (int(word) / 1000 for word in words[1:])
            self.steering_rad, self.speed_mps = steering, speed[0] if speed else None
            self.commands += 1
            self._commanded_s = now_s
        return b""
