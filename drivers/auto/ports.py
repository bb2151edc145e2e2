"""Where a lidar may be: at a serial port that is not the motor's, or at the address that a Hokuyo comes with."""

from pathlib import Path
from typing import Final

from wallride.drivers.address import SerialAddress, parse_address
from wallride.drivers.hokuyo.settings import HokuyoSettings

NAMES: Final = ("wallride-lidar", "serial/by-id/*", "ttyUSB*", "ttyACM*")
"""Names of serial ports, those first that stay when others are plugged in."""


def places(address: str, motor: str, devices: Path = Path("/dev")) -> list[str]:
    """Return the addresses to look at: the one named, or all.

    motor: its address, which is never looked at: nothing but its own driver may send to it. devices: the folder of
        the ports.
    """
    if address:
        return [address]
    taken = _device(motor)
    found: dict[Path, Path] = {}
    for pattern in NAMES:
        for name in sorted(devices.glob(pattern)):
            found.setdefault(name.resolve(), name)
    ports = [f"serial://{name}" for device, name in found.items() if device != taken]
    return [*ports, str(HokuyoSettings().address)]


def _device(address: str) -> Path | None:
    """Return the device of a serial address, None for another."""
    try:
        parsed = parse_address(address)
    except ValueError:  # of an own driver, whose addresses are its own affair
        return None
    return Path(parsed.path).resolve() if isinstance(parsed, SerialAddress) else None
