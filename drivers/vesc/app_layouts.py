"""Layouts of the VESC's application configuration, by the signature with which it begins. Facts, no functions.

The signature changes with every change of the layout, so that a known one makes every byte certain. Source:
vedderb/bldc `confgenerator.h` and `confgenerator.c` of the tags 3.60 to 5.02 and the branches release_5_03 to
release_7_00. Every layout begins with: signature uint32, controller id uint8, timeout uint32 [ms], timeout brake
current float [A].
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class AppLayout:
    """Places in bytes, counted from the signature.

    servo_output: None before firmware 5.03, which needs a special build. rounded: places of the 16-bit numbers which
    the firmware keeps as floats and truncates when it tells them, so that they can lose one unit by being written.
    """

    firmware: str
    size_bytes: int
    application: int
    servo_output: int | None = None
    rounded: tuple[int, ...] = ()


_BALANCE_5_03: Final = (245, 247, 249, 251, 253, 259, 261, 267)
_ADC_6: Final = (80, 95, 97, 99, 101, 103, 105, 107)

LAYOUTS: Final = {
    543202478: AppLayout("3.60", 256, 22),
    583966563: AppLayout("3.61 and 3.62", 264, 22),
    783041200: AppLayout("3.63 to 3.67", 331, 22),
    1232755601: AppLayout("4.02", 367, 22),
    2460147246: AppLayout("5.00 and 5.01", 389, 22),
    3264926020: AppLayout("5.02", 418, 23, rounded=(330, 332, 334, 340, 342)),
    3733512279: AppLayout("5.03", 476, 29, 27, (76, *_BALANCE_5_03, 283, 404, 406, 408, 414, 416)),
    486554156: AppLayout(
        "6.00 and 6.02", 493, 33, 31,
        (*_ADC_6, 256, 258, 260, 262, 264, 270, 272, 278, 294, 411, 413, 415, 421, 423, 430, 432, 434, 436),
    ),
    2099347128: AppLayout("6.05 and 6.06", 278, 33, 31, (*_ADC_6, 196, 198, 200, 206, 208, 215, 217, 219, 221)),
    2384027283: AppLayout("7.00", 284, 33, 31, (*_ADC_6, 184, 202, 204, 206, 212, 214, 221, 223, 225, 227)),
}  # fmt: skip
"""By signature."""
