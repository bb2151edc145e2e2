"""The lidar, opened by its own driver: does it answer, what does it say of itself, what does it see."""

import asyncio
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.drivers.api import Health, LinkState, Scan
from wallride.runtime.ending import end
from wallride.runtime.lidars import lidar_for
from wallride.runtime.settings.devices import AnyLidarSettings, TopicLidarSettings

WANTED_SCANS: Final = 20
PATIENCE_S: Final = 8.0
AGAIN_S: Final = 1.5
"""Time for a second attempt: a sensor that just lost its client refuses the first."""
MIN_SEEN_SHARE: Final = 0.2
COVERED_M: Final = 0.15
COVERED_SHARE: Final = 0.5
_POLL_S: Final = 0.02

_ANOTHER: Final = "another lidar, or ?baud= in lidar.address? `--set lidar.driver=auto` finds it"

REMEDIES: Final = (
    ("two lidars answer", "name the address of the one that the car drives with in lidar.address"),
    ("no lidar found", "plug it in and power it (5 V, 1 A when its motor starts); or name it in lidar.driver"),
    ("does not start measuring", "use a USB hub with a supply: the motor takes up to 1 A when it starts"),
    ("repeats one turn", "unplug it for a moment; if it comes back, have it repaired"),
    ("only zero bytes", "use a USB hub with a supply, and a short cable; then another adapter"),
    ("packets of a YDLIDAR", 'set lidar.driver = "ydlidar"; of an X2 or X4 Pro also lidar.model'),
    ("as a Hokuyo sends it", 'set lidar.driver = "hokuyo"'),
    ("lidar.model names", "take lidar.model out of the settings, or name the model that it is"),
    ("nothing came", f"check its supply (5 V, 1 A when its motor starts) and cable; {_ANOTHER}"),
    ("stray bytes", f"check its supply (5 V, 1 A when its motor starts); {_ANOTHER}"),
    ("other bytes came", "look what is on this port; unplug the device for a moment and try again"),
    ("something else came", "end the other program that uses this port, and unplug the device for a moment"),
    ("no scan packet", "name its model in lidar.model, check its supply: these models never answer"),
    ("reset does not clear", "free its head and unplug it for a moment; if it comes back, have it repaired"),
    ("no whole turn", "free its head; check the small cable of its motor, and its supply"),
    ("too few samples", 'set lidar.mode = "typical", or slow its head down'),
    ("unknown model", "name a model like it in lidar.model"),
    ("refused", "end the other program that is connected (a sensor serves only one), and check the port"),
    ("closed it", "end the other program that is connected (a sensor serves only one)"),
    ("reset", "end the other program that is connected, or switch the sensor off and on"),
    ("no route", "give this computer an address in the sensor's network: see `lidar network`"),
    ("network unreachable", "give this computer an address in the sensor's network: see `lidar network`"),
    ("no answer", f"check its power (by its manual), its cable, and lidar.address; {_ANOTHER}"),
    ("scans come", "look for what is slow between the sensor and this computer: a switch, Wi-Fi, a busy processor"),
    ("another program", "end the program that holds the port"),
    ("permission", "sudo usermod -aG dialout USER, then log out and in again"),
    ("no such device", "plug it in; install the udev rules: sudo wallride service install"),
    ("trouble", "switch the sensor off and on; if it comes back, have it repaired"),
    ("checks itself", "shade it from sunlight, wipe its window"),
)
_OTHERWISE: Final = "check its power and cable, and switch it off and on"


@dataclass(slots=True)
class LidarReport:
    """Answer of one look. scans: the newest WANTED_SCANS at most."""

    health: Health
    scans: list[Scan] = field(default_factory=list)


async def look_at_lidar(settings: AnyLidarSettings, *, patience_s: float = PATIENCE_S) -> LidarReport:
    """Run the driver until enough scans came, or it failed twice; the sensor is left quiet."""
    clock = asyncio.get_running_loop().time
    driver = lidar_for(settings, clock=clock)
    report = LidarReport(driver.health)
    running = asyncio.create_task(driver.run(report.scans.append))
    give_up_s = clock() + patience_s
    failed, trouble = False, ""
    try:
        while len(report.scans) < WANTED_SCANS and clock() < give_up_s and not running.done():
            if not failed and driver.health.counts.get("reconnect"):
                failed = True
                give_up_s = min(give_up_s, clock() + AGAIN_S)
            if driver.health.link in {LinkState.ABSENT, LinkState.FAULTY}:
                trouble = driver.health.message
            await asyncio.sleep(_POLL_S)
    finally:
        report.health = Health(**{name: getattr(driver.health, name) for name in Health.__slots__})
        if report.health.link is LinkState.STARTING:
            report.health.message = trouble or report.health.message  # it is being tried again
        for error in await end(running):
            raise error
    return report


def scans_from_elsewhere(settings: TopicLidarSettings) -> Finding:
    """Say what cannot be looked at: scans reach only a car that runs."""
    return warn(
        "lidar", f"its scans come from another program, on topic {settings.topic}: not looked at",
        "start that program and wallride run; wallride status says what comes, or why it is refused",
    )  # fmt: skip


def judge_lidar(report: LidarReport) -> list[Finding]:
    """Judge one look."""
    health = report.health
    if not report.scans:
        return [fail("lidar", health.message, remedy_of(health.message))]
    if health.link is not LinkState.READY:
        judge = warn if len(report.scans) >= WANTED_SCANS else fail
        return [judge("lidar", health.message, remedy_of(health.message))]
    words = "; ".join(dict.fromkeys(filter(None, (health.identity, health.message))))
    found = [ok("lidar", words)]
    if "says of itself" in health.message:
        found = [warn("lidar", words, "switch it off and on; wipe its window")]
    if "its head turns at" in health.message:
        found.append(
            warn("lidar motor", health.message, "use a USB hub with a supply; take what touches its head away")
        )
    if faults := [what for what in health.counts if what.startswith("error 0x")]:
        found.append(
            warn(
                "lidar condition",
                f"it reported {', '.join(faults)}",
                "if it comes back, have its motor and laser checked",
            )
        )
    if bad := {what: count for what, count in health.counts.items() if what == "checksum"}:
        found.append(
            warn("lidar line", f"{bad['checksum']} damaged replies", "check the cable, keep it away from the motor's")
        )
    return [*found, _window(report.scans[-1].ranges_m)]


def _window(ranges_m: np.ndarray) -> Finding:
    seen = np.isfinite(ranges_m)
    if seen.mean() < MIN_SEEN_SHARE:
        return warn(
            "lidar window", f"only {seen.mean():.0%} of its beams return",
            "take the cap off, wipe the window, let it see walls within its range",
        )  # fmt: skip
    near = float((ranges_m[seen] < COVERED_M).mean())
    if near > COVERED_SHARE:
        return warn("lidar window", f"{near:.0%} of what it sees is nearer than {COVERED_M:g} m", "uncover its window")
    return ok("lidar window", f"{seen.mean():.0%} of its beams return")


def remedy_of(message: str) -> str:
    """Return what to do about a message of the driver."""
    return next((remedy for words, remedy in REMEDIES if words in message), _OTHERWISE)
