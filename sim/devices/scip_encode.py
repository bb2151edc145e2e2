"""SCIP 2.x encoder of the sensor's side: values to reply blocks. Pure; deliberately not built on the driver's codec.

What both share is only the golden bytes that their tests check them against.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

STAMP_WRAP_MS: Final = 1 << 24
_LINE_CHARS: Final = 64


@dataclass(frozen=True, slots=True)
class SensorModel:
    """Identity of a sensor: PP (steps, mm, rpm) and VV. `intensities`: it supports ME and GE."""

    model: str
    range_min_mm: int
    range_max_mm: int
    steps_per_turn: int
    first_step: int
    last_step: int
    front_step: int
    speed_rpm: int
    product: str
    firmware: str
    protocol: str
    serial: str
    vendor: str = "Hokuyo Automatic Co.,Ltd."
    intensities: bool = True
    serial_port: bool = False

    @property
    def beam_count(self) -> int:
        """Return the number of samples of a full scan."""
        return self.last_step - self.first_step + 1

    @property
    def period_s(self) -> float:
        """Return the time of one revolution."""
        return 60 / self.speed_rpm

    def parameters(self) -> dict[str, str]:
        """Return the lines of PP."""
        return {
            "MODL": self.model,
            "DMIN": str(self.range_min_mm),
            "DMAX": str(self.range_max_mm),
            "ARES": str(self.steps_per_turn),
            "AMIN": str(self.first_step),
            "AMAX": str(self.last_step),
            "AFRT": str(self.front_step),
            "SCAN": str(self.speed_rpm),
        }

    def version(self) -> dict[str, str]:
        """Return the lines of VV."""
        return {
            "VEND": self.vendor,
            "PROD": self.product,
            "FIRM": self.firmware,
            "PROT": self.protocol,
            "SERI": self.serial,
        }


UST_10LX: Final = SensorModel(
    "UST-10LX", 20, 30000, 1440, 0, 1080, 540, 2400, "SOKUIKI Sensor UST-10LX", "1.1.8", "SCIP 2.2", "H0000010"
)
UTM_30LX: Final = SensorModel(
    "UTM-30LX",
    23,
    60000,
    1440,
    0,
    1080,
    540,
    2400,
    "SOKUIKI Sensor TOP-URG UTM-30LX",
    "1.18.01",
    "SCIP 2.0",
    "H0000030",
)
URG_04LX: Final = SensorModel(
    "URG-04LX(Hokuyo Automatic Co., Ltd.)",
    20,
    5600,
    1024,
    44,
    725,
    384,
    600,
    "SOKUIKI Sensor URG-04LX-UG01(Simple-URG)",
    "3.3.01(23/Jun./2008)",
    "SCIP 2.0",
    "H0905389",
    intensities=False,
    serial_port=True,
)


def sum_character(text: bytes) -> bytes:
    """Return the checksum of a line as the character that follows it."""
    return bytes([(sum(text) & 0x3F) + 0x30])


def encode_number(value: int, chars: int) -> bytes:
    """Encode a value that fits six bits a character, most significant first."""
    return bytes((value >> 6 * place & 0x3F) + 0x30 for place in reversed(range(chars)))


def encode_block(echo: bytes, status: str, lines: Iterable[bytes] = ()) -> bytes:
    """Frame a reply; lines get their sums. A status of one character is SCIP 1.1 and has none."""
    text = status.encode("ascii")
    head = text + sum_character(text) if len(text) > 1 else text
    return b"\n".join([echo, head, *(line + sum_character(line) for line in lines)]) + b"\n\n"


def encode_fields(echo: bytes, values: Mapping[str, str]) -> bytes:
    """Frame a reply of KEY:VALUE; lines, whose sum leaves the semicolon out."""
    lines = (f"{key}:{value}".encode("ascii") for key, value in values.items())
    return b"\n".join([echo, b"00P", *(line + b";" + sum_character(line) for line in lines)]) + b"\n\n"


def encode_samples(values: npt.NDArray[np.integer], chars: int) -> bytes:
    """Encode an integer array (any shape, C order), `chars` characters each; ValueError for values that do not fit."""
    flat = np.asarray(values, np.int64).ravel()
    if flat.size and (flat.min() < 0 or flat.max() >= 64**chars):
        raise ValueError(f"{chars} characters carry 0 to {64**chars - 1}, not {flat.min()} to {flat.max()}")
    shifts = 6 * np.arange(chars - 1, -1, -1)
    return (((flat[:, None] >> shifts) & 0x3F) + 0x30).astype(np.uint8).tobytes()


def encode_scan(echo: bytes, status: str, stamp_ms: int, samples: bytes) -> bytes:
    """Frame a scan: the stamp (24 bits) on a line of its own, then the samples in lines of 64 characters."""
    cut = (samples[at : at + _LINE_CHARS] for at in range(0, len(samples), _LINE_CHARS))
    return encode_block(echo, status, [encode_number(stamp_ms % STAMP_WRAP_MS, 4), *cut])


def cluster_minimum(ranges_mm: npt.NDArray[np.integer], cluster: int) -> npt.NDArray[np.integer]:
    """Return the minimum of each `cluster` neighbours, as a sensor groups steps; 0 and 1 leave the ranges unchanged."""
    if cluster <= 1:
        return ranges_mm
    least: npt.NDArray[np.integer] = np.minimum.reduceat(ranges_mm, np.arange(0, len(ranges_mm), cluster))
    return least
