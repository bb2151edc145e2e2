"""The computer's condition: scheduling, clock, disk, clock rate of the processor, heat, supply."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from wallride.doctor.computer import REALTIME_PRIORITY, Computer
from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.runtime.host.computer import HOT_C, ComputerReading, read_computer
from wallride.runtime.settings.recording import RecordingSettings, car_folder
from wallride.runtime.settings.tree import Settings

UNIT: Final = "/etc/systemd/system/wallride.service"
SERVICE_RECORDINGS: Final = "/var/lib/wallride/recordings"
MB: Final = 1_000_000
MIN_FREE_MB: Final = 64
SLOW_GOVERNOR: Final = "powersave"
STEPLESS_DRIVERS: Final = frozenset({"intel_pstate", "amd-pstate", "amd-pstate-epp"})
"""Frequency drivers whose `powersave` follows the load."""
JETSON: Final = "/etc/nv_tegra_release"
BUILT: Final = datetime.fromtimestamp(Path(__file__).stat().st_mtime, UTC)
"""No clock of a car that has this file can be before it."""


def check_condition(computer: Computer, settings: Settings) -> list[Finding]:
    """Look at the computer."""
    return [
        _scheduling(computer),
        _clock(computer),
        _disk(computer, settings.recording, settings.car.name),
        _governor(computer),
        *_heat(read_computer(computer.path("/sys"))),
    ]


def _scheduling(computer: Computer) -> Finding:
    refusal = computer.realtime_refusal()
    if not refusal:
        return ok("scheduling", "SCHED_FIFO is allowed")
    unit = computer.text(UNIT)
    if f"LimitRTPRIO={REALTIME_PRIORITY}" in unit:
        return ok("scheduling", "the service may use SCHED_FIFO; by hand it drives with ordinary scheduling")
    return warn(
        "scheduling", f"SCHED_FIFO is refused ({refusal}): other programs delay the motor's commands",
        "let the service drive, which has the right: sudo wallride service install",
    )  # fmt: skip


def _clock(computer: Computer) -> Finding:
    now = datetime.fromtimestamp(computer.now_unix_s, UTC)
    words = f"{now:%Y-%m-%d %H:%M} UTC"
    if now < BUILT.replace(hour=0, minute=0, second=0):
        return warn(
            "clock", f"{words}, before this program was installed: certificates and recordings get wrong times",
            "connect it to the internet once, or: sudo date --set 'YYYY-MM-DD HH:MM'",
        )  # fmt: skip
    return ok("clock", words)


def _disk(computer: Computer, settings: RecordingSettings, car: str) -> Finding:
    if not settings.enabled:
        return ok("disk", "recording is off")
    service = computer.path(SERVICE_RECORDINGS)
    folder = service if not settings.folder and service.is_dir() else car_folder(settings, car)
    free_mb = computer.free_bytes(folder) // MB
    words = f"{free_mb / 1000:.1f} GB free for recordings"
    remedy = "free space: wallride logs trim, or remove other files; or set recording.folder to another disk"
    if free_mb < MIN_FREE_MB:
        return fail("disk", words, remedy)
    if free_mb < settings.keep_free_mb:
        return warn("disk", f"{words}, less than recording.keep_free_mb: old recordings are deleted", remedy)
    return ok("disk", words)


def _governor(computer: Computer) -> Finding:
    slow = []
    for folder in sorted(computer.path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq")):
        name = folder.relative_to(computer.root)
        if computer.text(f"{name}/scaling_driver") in STEPLESS_DRIVERS:
            continue
        if computer.text(f"{name}/scaling_governor") == SLOW_GOVERNOR:
            slow.append(folder.parent.name)
    if not slow:
        return ok("processor", "its clock is not held down")
    remedy = "sudo cpupower frequency-set --governor performance"
    if computer.path(JETSON).exists():
        remedy = "sudo nvpmodel -m 0 && sudo jetson_clocks"
    return warn("processor", f"{', '.join(slow)}: held at the lowest clock (governor {SLOW_GOVERNOR})", remedy)


def _heat(reading: ComputerReading) -> list[Finding]:
    """Judge heat and supply; over-current events count since the computer's start."""
    shown = f"{reading.temperature_c:.0f} C" if reading.zone else "not reported"
    problems = reading.trouble(ComputerReading(hot_c=HOT_C))
    if not problems:
        return [ok("heat and supply", shown)]
    found = []
    for problem in problems.split("; "):
        words, _, remedy = problem.partition(": ")
        found.append(warn("heat and supply", f"{words} ({shown})", remedy))
    return found
