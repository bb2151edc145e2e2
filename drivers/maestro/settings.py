"""Settings of a Pololu Maestro."""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from wallride.drivers.address import TcpAddress, parse_address
from wallride.drivers.pwm.settings import PwmSettings

LOOPBACK = frozenset({"127.0.0.1", "::1"})


class MaestroSettings(PwmSettings):
    """A Maestro in the mode USB Dual Port, or behind a serial line. Its serial timeout is set in its Control Center."""

    driver: Annotated[Literal["maestro"], Field(description="Type of the motor controller.")] = "maestro"
    address: Annotated[str, Field(description="Its command port, the first of the two: serial:///dev/NAME.")] = (
        "serial:///dev/ttyACM0"
    )

    @field_validator("address")
    @classmethod
    def _is_at_hand(cls, text: str) -> str:
        match parse_address(text):
            case TcpAddress(host=host) if host not in LOOPBACK:
                raise ValueError(f"{text!r} is another computer, and a brake must not depend on a network")
            case _:
                return text
