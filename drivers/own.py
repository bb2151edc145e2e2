"""Names for drivers of your own: what a driver is given, and what it delivers. See docs/your-own-driver.md."""

from wallride.drivers.address import parse_address
from wallride.drivers.api import Clock, Drive, Health, LinkLost, LinkState, MotorState, ProtocolError, Scan
from wallride.drivers.link import ByteLink, open_link, until_lost
from wallride.drivers.section import Section

__all__ = [
    "ByteLink", "Clock", "Drive", "DriverSettings", "Health", "LinkLost", "LinkState", "MotorState", "ProtocolError",
    "Scan", "open_link", "parse_address", "until_lost",
]  # fmt: skip


class DriverSettings(Section):
    """Base class of a driver's settings: a pydantic model, closed to unknown keys; every key needs a default."""
