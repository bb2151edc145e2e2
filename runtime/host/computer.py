"""Temperature and throttling of the computer, as Linux, a Jetson's and a Raspberry Pi's drivers report them in /sys.

* `class/thermal/thermal_zone*`: temperature in 1/1000 C, and the trip points; Jetsons name their zones `CPU-therm`,
  `tj-thermal`. A zone without a sensor behind it answers EAGAIN or a negative number.
* `class/thermal/cooling_device*` whose type names a processor: a state above 0 is a lowered clock.
* `class/hwmon/hwmon*/oc*_event_cnt`: a Jetson Orin's over-current events ("system throttled due to over-current").
* `devices/platform/soc/soc:firmware/get_throttled`: a Raspberry Pi's flags.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

SYS: Final = Path("/sys")
HOT_C: Final = 85.0
"""Temperature from which the computer counts as hot where it names no trip point of its own."""
_CRITICAL: Final = frozenset({"passive", "hot"})
_PROCESSORS: Final = ("cpu", "processor", "gpu", "devfreq")
_PI_UNDER_VOLTAGE: Final = 0x1
_PI_SLOWED: Final = 0x2 | 0x4 | 0x8


@dataclass(frozen=True, slots=True)
class ComputerReading:
    """One reading.

    temperature_c: of the hottest zone, NaN where none is reported; zone: its name; hot_c: where that zone is slowed.
    slowed: the processors whose clock is lowered now. over_current: number of events since boot.
    under_voltage: the supply is too weak now.
    """

    temperature_c: float = math.nan
    zone: str = ""
    hot_c: float = HOT_C
    slowed: tuple[str, ...] = ()
    over_current: int = 0
    under_voltage: bool = False

    def trouble(self, before: "ComputerReading") -> str:
        """Return what is wrong and the remedy, "" when all is well; constant text while it lasts."""
        said = []
        if self.temperature_c >= self.hot_c:
            said.append(f"the computer is hot ({self.zone}): give it air, or lower its power mode")
        if self.slowed:
            said.append(f"the computer is slowed down ({', '.join(self.slowed)}): too hot, or a weak supply")
        if self.over_current > before.over_current:
            said.append("the computer draws too much current: lower its power mode, or use a stronger supply")
        if self.under_voltage:
            said.append("the computer's supply voltage is too low: stronger supply, shorter cable")
        return "; ".join(said)

    def fields(self) -> dict[str, Any]:
        """Return plain values for the status."""
        return {
            "temperature_c": self.temperature_c,
            "zone": self.zone,
            "slowed": list(self.slowed),
            "over_current": self.over_current,
        }


def read_computer(sys: Path = SYS) -> ComputerReading:
    """Read everything once. May take some milliseconds: not for the event loop. Never raises."""
    try:
        return _read(sys)
    except OSError:  # no descriptor is left to list a folder
        return ComputerReading()


def _read(sys: Path) -> ComputerReading:
    temperature_c, zone, hot_c = max(
        (found for folder in sorted(sys.glob("class/thermal/thermal_zone*")) if (found := _zone(folder)) is not None),
        default=(math.nan, "", HOT_C),
    )
    flags = _number(sys / "devices/platform/soc/soc:firmware/get_throttled", base=16) or 0
    slowed = [_text(folder / "type") for folder in sorted(sys.glob("class/thermal/cooling_device*")) if _slows(folder)]
    if flags & _PI_SLOWED:
        slowed.append("cpu")
    counts = [_number(path) or 0 for path in sys.glob("class/hwmon/hwmon*/oc*_event_cnt")]
    return ComputerReading(
        temperature_c, zone, hot_c, tuple(dict.fromkeys(slowed)), sum(counts), bool(flags & _PI_UNDER_VOLTAGE)
    )


def _zone(folder: Path) -> tuple[float, str, float] | None:
    milli_c = _number(folder / "temp")
    if milli_c is None or milli_c <= 0:
        return None
    trips_c = [
        trip / 1000
        for kind in sorted(folder.glob("trip_point_*_type"))
        if _text(kind) in _CRITICAL and (trip := _number(kind.with_name(kind.name.replace("type", "temp"))))
    ]
    return milli_c / 1000, _text(folder / "type"), min(trips_c, default=HOT_C)


def _slows(folder: Path) -> bool:
    kind = _text(folder / "type").lower()
    return any(word in kind for word in _PROCESSORS) and bool(_number(folder / "cur_state"))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:  # a zone without a sensor answers with an error, and a device may go while it is read
        return ""


def _number(path: Path, base: int = 10) -> int | None:
    try:
        return int(_text(path), base)
    except ValueError:
        return None
