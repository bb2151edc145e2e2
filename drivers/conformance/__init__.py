"""Tests that every driver has to pass, for pytest: subclass `LidarConformance` or `MotorConformance`.

See docs/your-own-driver.md. The bench is the device's other end: an emulator of yours behind a port of this package, or
whatever else can do what `LidarBench` or `MotorBench` name.
"""

from wallride.drivers.conformance.bench import EmulatorBench, LidarBench, LidarEmulator, MotorBench, MotorEmulator
from wallride.drivers.conformance.lidar import LidarConformance
from wallride.drivers.conformance.motor import MotorConformance

__all__ = [
    "EmulatorBench", "LidarBench", "LidarConformance", "LidarEmulator", "MotorBench", "MotorConformance",
    "MotorEmulator",
]  # fmt: skip
