"""Names for drivers of your own: what a driver is given, and what it delivers. See docs/your-own-driver.md."""

from pydantic import BaseModel, ConfigDict

from wallride.drivers.address import parse_address
from wallride.drivers.api import Clock, Drive, Health, LinkLost, LinkState, MotorState, ProtocolError, Scan
from wallride.drivers.link import ByteLink, open_link, until_lost

__all__ = [
    "ByteLink", "Clock", "Drive", "DriverSettings", "Health", "LinkLost", "LinkState", "MotorState", "ProtocolError",
    "Scan", "open_link", "parse_address", "until_lost",
]  # fmt: skip


class DriverSettings(BaseModel):
    """Base class of a driver's settings: a pydantic model, closed to unknown keys; every key needs a default."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
