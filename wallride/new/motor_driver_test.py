"""The tests that every motor's driver has to pass, and one of this one. Needs pytest."""

from wallride.drivers.conformance import EmulatorBench, MotorConformance
from wallride.new.motor_driver import MotorDriver, line, read
from wallride.new.motor_emulator import MotorDevice


class TestMotorDriver(MotorConformance):
    """See docs/your-own-driver.md for what it checks."""

    def bench(self) -> EmulatorBench:
        """Return the emulator behind a port."""
        return EmulatorBench(MotorDriver, MotorDevice())


def test_a_damaged_line_is_none() -> None:
    """The checksum tells."""
    assert read(line("D", 0.1, 1.0).strip()) == ["D", "100", "1000"]
    assert read(b"D 101 1000 *1") == []
