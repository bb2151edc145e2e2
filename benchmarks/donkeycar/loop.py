"""The report's laws as parts in donkeycar's vehicle loop: `PYTHON loop.py SCANS_FILE RATE_HZ LOOP_HZ SCANS`.

For a venv of its own: `python -m venv dk && dk/bin/pip install donkeycar`. The scans come from a threaded part, as a
lidar's do; the time is taken from a scan's arrival to the run of the part that would write to the motor. Prints
one line of JSON: the time of each answered scan in ms.
"""

import json
import math
import sys
import time
from pathlib import Path

import numpy as np
from donkeycar.vehicle import Vehicle

SPEED_MPS, DESIRED_M, KP, KD = 1.0, 1.0, 1.6, 1.5
NONSENSE_BELOW_M, CORNER_M, STOP_BELOW_M = 0.2, 2.0, 0.933
WARM_UP = 80


class LidarPart:
    """A threaded part: a new scan at a steady rate."""

    def __init__(self, scans_m: np.ndarray, rate_hz: float) -> None:
        self._scans_m, self._rate_hz = scans_m, rate_hz
        self._newest = (0, scans_m[0])
        self._on = True
        self.came_s: list[float] = []

    def update(self) -> None:
        """Publish scans in a thread of donkeycar's."""
        next_s = time.monotonic()
        while self._on:
            next_s += 1 / self._rate_hz
            time.sleep(max(0.0, next_s - time.monotonic()))
            count = len(self.came_s) + 1
            self._newest = (count, self._scans_m[count % len(self._scans_m)])
            self.came_s.append(time.monotonic())

    def run_threaded(self) -> tuple[int, np.ndarray]:
        """Return the newest scan and its number."""
        return self._newest

    def shutdown(self) -> None:
        """End the thread."""
        self._on = False


class WallFollower:
    """Steers by the report's law."""

    def run(self, number: int, ranges_m: np.ndarray) -> tuple[int, float, float]:
        """Return the scan's number, steering [rad] and the distance ahead [m]."""
        beams = len(ranges_m)
        step_rad = 1.5 * math.pi / (beams - 1)
        first, last = (round((share * math.pi + 0.75 * math.pi) / step_rad) for share in (0.1, 0.6))
        side_m = ranges_m[first : last + 1]
        angles_rad = -0.75 * math.pi + np.arange(first, last + 1) * step_rad
        usable = side_m > NONSENSE_BELOW_M
        side_m, angles_rad = side_m[usable], angles_rad[usable]
        ahead = ranges_m[beams // 2 - 2 : beams // 2 + 3]
        ahead_m = float(np.partition(ahead, 2)[:3].mean())
        if side_m.size < 3:
            return number, 0.0, ahead_m
        x_m, y_m = side_m * np.cos(angles_rad), side_m * np.sin(angles_rad)
        x_m, y_m = x_m - x_m.mean(), y_m - y_m.mean()
        angle_rad = math.atan(float(x_m @ y_m) / float(x_m @ x_m))
        distance_m = ahead_m / 2 if ahead_m <= CORNER_M else float(np.partition(side_m, 2)[:3].mean())
        steering_rad = 0.0 if abs(angle_rad) > math.pi / 3 else KD * angle_rad + KP * (distance_m - DESIRED_M)
        return number, steering_rad, ahead_m


class Safety:
    """Stops before near obstacles."""

    def run(self, ahead_m: float) -> float:
        """Return the speed."""
        return 0.0 if ahead_m < STOP_BELOW_M else SPEED_MPS


class MotorPart:
    """Takes the place of the motor's writer."""

    def __init__(self, vehicle: Vehicle, scans: int) -> None:
        self._vehicle, self._scans = vehicle, scans
        self.answered_s: dict[int, float] = {}

    def run(self, number: int, steering_rad: float, speed_mps: float) -> None:  # noqa: ARG002 - it would write them
        """Record the time of the first command for a scan; end the drive after enough."""
        if number and number not in self.answered_s:
            self.answered_s[number] = time.monotonic()
        if number > WARM_UP + self._scans:
            self._vehicle.on = False


def main() -> None:
    """Drive, and print the times."""
    file, rate_hz, loop_hz, scans = Path(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
    raw = file.read_bytes()
    beams, free, _ = np.frombuffer(raw, np.int32, 3)
    scans_m = np.frombuffer(raw, np.float32, free * beams, 12).reshape(free, beams)
    vehicle = Vehicle()
    lidar = LidarPart(scans_m, rate_hz)
    motor = MotorPart(vehicle, scans)
    vehicle.add(lidar, outputs=["number", "ranges"], threaded=True)
    vehicle.add(WallFollower(), inputs=["number", "ranges"], outputs=["answered", "steering", "ahead"])
    vehicle.add(Safety(), inputs=["ahead"], outputs=["speed"])
    vehicle.add(motor, inputs=["answered", "steering", "speed"])
    vehicle.start(rate_hz=loop_hz)
    times_ms = [
        1000 * (at_s - lidar.came_s[number - 1])
        for number, at_s in motor.answered_s.items()
        if number > WARM_UP and number <= len(lidar.came_s)
    ]
    print(json.dumps({"latency_ms": times_ms}))


if __name__ == "__main__":
    main()
