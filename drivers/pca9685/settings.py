"""Settings of a PCA9685."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.pwm.settings import PwmSettings


class Pca9685Settings(PwmSettings):
    """A PCA9685 on an I2C bus of this computer. It has no command timeout, which bounds the speed."""

    driver: Annotated[Literal["pca9685"], Field(description="Type of the motor controller.")] = "pca9685"
    bus: Annotated[int, Field(ge=0, le=255, description="Number of the I2C bus: /dev/i2c-N.")] = 1
    socket: Annotated[
        str, Field(max_length=100, description="Unix socket of an emulated board in place of the bus.")
    ] = ""
    chip: Annotated[int, Field(ge=0x08, le=0x77, description="I2C address of the board; 64 is 0x40.")] = 0x40
    rate_hz: Annotated[float, Field(ge=40, le=120, description="Pulses a second.")] = 60.0
