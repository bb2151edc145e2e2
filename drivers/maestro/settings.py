"""Settings of a Pololu Maestro."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from wallride.drivers.address import at_hand
from wallride.drivers.pwm.settings import PwmSettings


class MaestroSettings(PwmSettings):
    """A Maestro in the mode USB Dual Port, or behind a serial line. Its serial timeout is set in its Control Center."""

    driver: Annotated[Literal["maestro"], Field(description="Type of the motor controller.")] = "maestro"
    address: Annotated[
        str,
        AfterValidator(at_hand),
        Field(description="Its command port, the first of the two: serial:///dev/NAME."),
    ] = "serial:///dev/ttyACM0"
