"""Whether a VESC stands still and takes commands from no program, by its own values."""

import asyncio
from typing import Final

from wallride.drivers.vesc.replies import STATUS_TIMED_OUT, Values
from wallride.drivers.vesc.settings_link import VescSettingsLink

OBSERVED_S: Final = 0.5
ASK_EVERY_S: Final = 0.02
SPARE_S: Final = 1.5
MAX_SHOWN_TIMEOUT_S: Final = 3.0
"""A longer command timeout, or none, is not waited for."""
STANDING_ERPM: Final = 300
"""Under it a VESC's speed is noise."""
STANDING_STEPS: Final = 1
IDLE_DUTY: Final = 0.005


async def why_not_idle(link: VescSettingsLink, timeout_s: float) -> str:
    """Return why the controller must not be written now; "" where it stood, uncommanded, for half a second.

    timeout_s: its command timeout: where its firmware reports it, it must have passed. LinkLost as of the link.
    """
    waited = 0 < timeout_s <= MAX_SHOWN_TIMEOUT_S
    clock = asyncio.get_running_loop().time
    now_s = clock()
    give_up_s = now_s + OBSERVED_S + SPARE_S + (timeout_s if waited else 0.0)
    idle_since_s, first, last_why = now_s, None, ""
    while (now_s := clock()) < give_up_s:
        values = await link.values()
        if values is None:
            return "the VESC does not tell its speed"
        why = _why_busy(values, first, needs_timeout=waited)
        if why:
            idle_since_s, first, last_why = clock(), None, why
        elif first is None:
            idle_since_s, first = clock(), values
        elif now_s - idle_since_s >= OBSERVED_S:
            return ""
        await asyncio.sleep(ASK_EVERY_S)
    return last_why or "the VESC answers too slowly"


def _why_busy(values: Values, first: Values | None, *, needs_timeout: bool) -> str:
    turned = first is not None and abs(values.tachometer - first.tachometer) > STANDING_STEPS
    if abs(values.erpm) >= STANDING_ERPM or turned:
        return f"the wheels turn ({values.erpm} ERPM): let the car stand"
    commanded = needs_timeout and values.status is not None and not values.status & STATUS_TIMED_OUT
    if commanded or abs(values.duty) > IDLE_DUTY:
        return "a program commands the motor: end it (wallride, VESC Tool, a remote control)"
    return ""
