"""The battery's limit on the speed: none while it is good, slow while it is low, a stop when it is empty.

A voltage counts after it has lasted: the motor's start is a dip of a tenth of a second. An empty battery recovers as
soon as the car stands, so that its stop holds until a better voltage has lasted.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, field_validator, model_validator

from wallride.drivers.api import MotorState
from wallride.drivers.section import Section

LASTS_S: Final = 1.0
"""Time for which a voltage is low before it counts."""
RECOVERED_BY_V: Final = 0.1
"""A low battery counts as good again this much above the limit, per cell."""
FULL_CELL_V: Final = 4.25
USB_ONLY_V: Final = 6.0
"""Minimum voltage of a pack; below it the USB cable feeds the motor controller alone."""
LOADED_ABOVE_A: Final = 2.0
"""Input current above which a voltage is one under load."""
CHECKED: Final = "the battery is being checked"
UNHEARD: Final = "the motor controller reports nothing (power, cable?)"
"""Why a car stands whose controller is away: no voltage, and nothing else of it, is known."""
NOT_YET: Final = "no report of the motor controller yet (power, cable?)"


class BatterySettings(Section):
    """The [battery] section. Limits are per cell; the motor controller measures the pack."""

    cells: Literal["auto", "1", "2", "3", "4", "5", "6", "8", "10", "12"] = "auto"
    """Cells in series; auto takes the fewest from which the first voltage can come."""

    low_v_per_cell: Annotated[float, Field(ge=0, le=4.2)] = 3.4
    """Below it for 1 s the speed is limited [V]."""

    cutoff_v_per_cell: Annotated[float, Field(ge=0, le=4.2)] = 3.2
    """Below it for 1 s the car stops [V]; lithium cells are damaged by less than 3.0."""

    low_speed_mps: Annotated[float, Field(gt=0, le=20)] = 1.0
    """The highest speed on a low battery."""

    settle_s: Annotated[float, Field(ge=0, le=30)] = 2.0
    """The voltage has to be good for so long before the car may move; 0 checks nothing at the start."""

    @field_validator("cells", mode="before")
    @classmethod
    def _as_text(cls, cells: object) -> object:
        """Accept `cells = 3` like `cells = "3"`."""
        return str(cells) if isinstance(cells, int) else cells

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.cutoff_v_per_cell > self.low_v_per_cell:
            raise ValueError(
                f"cutoff_v_per_cell {self.cutoff_v_per_cell} is above low_v_per_cell {self.low_v_per_cell}:"
                " the car slows down first and stops later"
            )
        return self


class Charge(StrEnum):
    """Judgement of a battery."""

    UNKNOWN = "unknown"
    """Not good for long enough yet: no motion."""
    GOOD = "good"
    LOW = "low"
    EMPTY = "empty"


@dataclass(slots=True)
class _Lasting:
    """How long a condition has held."""

    since_s: float | None = None

    def held_s(self, now_s: float, *, holds: bool) -> float:
        """Return for how long it has held now; minus infinity while it does not."""
        if not holds:
            self.since_s = None
            return -math.inf
        if self.since_s is None:
            self.since_s = now_s
        return now_s - self.since_s


@dataclass(slots=True)
class BatteryMonitor:
    """Judges the voltage of the pack, from report to report.

    cells: of the pack, 0 while unknown. trouble: why the speed is limited, "" while it is not; constant while it
    lasts. limit_mps: the ceiling in either direction, infinity without one. sag_v: minimum voltage under load since the
    controller was connected, NaN before any load.
    """

    settings: BatterySettings
    charge: Charge = Charge.UNKNOWN
    cells: int = 0
    trouble: str = ""
    limit_mps: float = math.inf
    voltage_v: float = math.nan
    sag_v: float = math.nan
    _connected: bool = True
    _good: _Lasting = field(default_factory=_Lasting)
    _low: _Lasting = field(default_factory=_Lasting)
    _empty: _Lasting = field(default_factory=_Lasting)

    def __post_init__(self) -> None:
        """Begin without a pack."""
        self.update(None)
        self.trouble = self.trouble and NOT_YET

    def update(self, state: MotorState | None) -> None:
        """Take in the motor controller's newest report, None while it is away."""
        if state is not None:
            if not self._connected and self.charge is Charge.UNKNOWN:
                self.trouble = CHECKED
            self._connected = True
            self._judge(state.voltage_v, state.stamp_s)
            if abs(state.input_current_a) >= LOADED_ABOVE_A:
                self.sag_v = min(state.voltage_v, self.sag_v)  # the first of two, where the other is NaN
        elif self._connected:
            self._connected, self.voltage_v, self.sag_v = False, math.nan, math.nan
            self.cells = 0 if self.settings.cells == "auto" else int(self.settings.cells)
            self._good, self._low, self._empty = _Lasting(), _Lasting(), _Lasting()
            if self.settings.settle_s:
                self._set(Charge.UNKNOWN, 0.0, UNHEARD)
            else:
                self._set(Charge.GOOD, math.inf, "")

    def fields(self) -> dict[str, Any]:
        """Return plain values for the status."""
        return {"charge": str(self.charge), "cells": self.cells or None, "sag_v": self.sag_v, "trouble": self.trouble}

    def _judge(self, voltage_v: float, now_s: float) -> None:
        settings, self.voltage_v = self.settings, voltage_v
        if math.isnan(voltage_v):  # the controller does not measure it
            self._set(Charge.GOOD, math.inf, "")
            return
        if not self.cells and voltage_v >= USB_ONLY_V:
            self.cells = math.ceil(voltage_v / FULL_CELL_V)
        cell_v = voltage_v / self.cells if self.cells else 0.0
        returns = self.charge in {Charge.LOW, Charge.EMPTY}
        good_v = settings.low_v_per_cell + (RECOVERED_BY_V if returns else 0.0)
        good_s = self._good.held_s(now_s, holds=cell_v >= good_v)
        low_s = self._low.held_s(now_s, holds=cell_v < settings.low_v_per_cell)
        empty_s = self._empty.held_s(now_s, holds=cell_v < settings.cutoff_v_per_cell)
        if good_s >= (max(settings.settle_s, LASTS_S) if returns else settings.settle_s):
            self._set(Charge.GOOD, math.inf, "")
        elif empty_s >= LASTS_S and self.charge is not Charge.EMPTY:
            self._set(Charge.EMPTY, 0.0, _empty_words(voltage_v))
        elif low_s >= LASTS_S and not returns:
            # A car that has not seen a good voltage does not begin to drive on a low one.
            limit_mps = settings.low_speed_mps if self.charge is Charge.GOOD else 0.0
            self._set(Charge.LOW, limit_mps, f"battery low: {voltage_v:.1f} V; charge or change it")

    def _set(self, charge: Charge, limit_mps: float, trouble: str) -> None:
        self.charge, self.limit_mps, self.trouble = charge, limit_mps, trouble


def _empty_words(voltage_v: float) -> str:
    if voltage_v < USB_ONLY_V:
        return f"no battery: {voltage_v:.1f} V; plug it in, release its switch"
    return f"battery empty: {voltage_v:.1f} V; charge or change it"
