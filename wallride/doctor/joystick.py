"""The gamepad on the car's computer, from /proc/bus/input/devices: there, in the right mode, allowed, usable."""

import re
from dataclasses import dataclass
from typing import Final

from wallride.doctor.computer import Computer
from wallride.doctor.findings import Finding, ok, warn
from wallride.runtime.host.extras import how_to_install

SUBJECT: Final = "gamepad"
F710_IN_D_MODE: Final = ("046d", "c219")
_IDS: Final = re.compile(r"Vendor=(\w{4}) Product=(\w{4})")


@dataclass(frozen=True, slots=True)
class Pad:
    """One gamepad; event: its file under /dev/input."""

    name: str
    vendor: str
    product: str
    event: str


def pads(listing: str) -> list[Pad]:
    """Return the gamepads of /proc/bus/input/devices: those with a joystick handler."""
    found = []
    for block in listing.split("\n\n"):
        handlers = re.search(r"Handlers=(.*)", block)
        ids = _IDS.search(block)
        words = handlers[1].split() if handlers else []
        if ids and any(word.startswith("js") for word in words):
            name = re.search(r'Name="(.*)"', block)
            event = next((word for word in words if word.startswith("event")), "")
            found.append(Pad(name[1] if name else "gamepad", ids[1].lower(), ids[2].lower(), event))
    return found


def check_joystick(computer: Computer) -> list[Finding]:
    """Look at the gamepads; a car without one is driven by keyboard, page, or from another computer."""
    there = pads(computer.text("/proc/bus/input/devices"))
    if not there:
        return [ok(SUBJECT, "none plugged in here; keyboard, page and other computers drive, too")]
    return [_judge(computer, pad) for pad in there]


def _judge(computer: Computer, pad: Pad) -> Finding:
    if (pad.vendor, pad.product) == F710_IN_D_MODE:
        return warn(SUBJECT, f"{pad.name} is in mode D, with other axes", "set the switch on its back to X")
    if pad.event and not computer.may_use(computer.device(f"/dev/input/{pad.event}")):
        return warn(
            SUBJECT, f"{computer.user} may not read {pad.name}",
            f"sudo usermod -aG input {computer.user}, then log out and in again",
        )  # fmt: skip
    if not computer.has_module("pygame"):
        return warn(
            SUBJECT,
            f"{pad.name}: the car reads it, and `wallride teleop` here cannot",
            how_to_install("teleop"),
        )
    return ok(SUBJECT, pad.name)
