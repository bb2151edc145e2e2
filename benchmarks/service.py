"""Boots a Debian under systemd-nspawn with the car's service and emulated devices, and measures what users wait for.

    debootstrap --variant=minbase --include=systemd,systemd-sysv,udev,python3,dbus bookworm ROOT
    sudo .venv/bin/python benchmarks/service.py ROOT

The root is changed: the service is installed into it by `wallride service install --root ROOT`. Its Python must have
the version of the one that runs this, whose packages and source are mounted read-only. Inside, a second unit plays the
devices and a third one (this file, with `--inside`) crashes, hangs and stops the service, reads systemd's own times and
the emulated motor controller's wire, and switches off.
"""

import argparse
import asyncio
import json
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

SOURCE: Final = Path(__file__).resolve().parents[1]
PREFIX: Final = "/opt/wallride"
MOUNTED: Final = {"/opt/source": SOURCE, "/opt/packages": Path(sysconfig.get_paths()["purelib"])}
WIRE: Final = Path("/run/emulator/wire")
RESULT: Final = Path("/var/lib/measured.json")
TIMEOUT_S: Final = 180.0
GAIN: Final = 4614.0
CAR: Final = """[car]
name = "booted"
[lidar]
address = "tcp://127.0.0.1:10940"
[motor]
address = "serial:///run/emulator/vesc"
[wall_follow]
method = "report"
[safety]
method = "report"
[operator]
permit = "always"
"""
EMULATOR: Final = """[Unit]
Before=wallride.service
[Service]
User=wallride
RuntimeDirectory=emulator
ExecStart=/opt/wallride/bin/python /opt/source/benchmarks/service.py --devices
[Install]
WantedBy=multi-user.target
"""
MEASURE: Final = """[Service]
ExecStart=/opt/wallride/bin/python /opt/source/benchmarks/service.py --inside
ExecStopPost=/bin/systemctl poweroff --no-block
StandardOutput=journal+console
[Install]
WantedBy=multi-user.target
"""


def main() -> int:
    """Run one of the three parts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("root", nargs="?", type=Path, help="the root made by debootstrap")
    parser.add_argument("--nspawn", default=shutil.which("systemd-nspawn"), help="the program")
    parser.add_argument("--devices", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.devices:
        asyncio.run(play_devices())
        return 0
    if options.inside:
        RESULT.write_text(json.dumps(measure(), indent=1), encoding="utf-8")
        return 0
    if options.root is None or options.nspawn is None:
        parser.error("needs a root and systemd-nspawn (package systemd-container)")
    prepare(options.root)
    boot(options.root, options.nspawn)
    print((options.root / RESULT.relative_to("/")).read_text(encoding="utf-8"))
    return 0


def prepare(root: Path) -> None:
    """Install program, service, devices and the measurement into the root."""
    from wallride import cli

    prefix = root / PREFIX.removeprefix("/")
    packages = prefix / f"lib/python3.{sys.version_info.minor}/site-packages"
    packages.mkdir(parents=True, exist_ok=True)
    (packages / "mounted.pth").write_text("".join(f"{target}\n" for target in MOUNTED), encoding="utf-8")
    (prefix / "bin").mkdir(exist_ok=True)
    (prefix / "pyvenv.cfg").write_text("home = /usr/bin\n", encoding="utf-8")
    python = prefix / "bin/python"
    python.unlink(missing_ok=True)
    python.symlink_to("/usr/bin/python3")
    command = prefix / "bin/wallride"
    command.write_text(
        f"#!{PREFIX}/bin/python\nfrom wallride.cli import main\nraise SystemExit(main())\n", encoding="utf-8"
    )
    command.chmod(0o755)
    for _ in range(2):  # the second time there is nothing to do
        if cli.main(["service", "install", "--yes", "--root", str(root), "--prefix", PREFIX]):
            raise SystemExit("the service was not installed")
    (root / "etc/wallride/car.toml").write_text(CAR, encoding="utf-8")
    wanted = root / "etc/systemd/system/multi-user.target.wants"
    for name, text in (("emulator", EMULATOR), ("measure", MEASURE)):
        (root / f"etc/systemd/system/{name}.service").write_text(text, encoding="utf-8")
        link = wanted / f"{name}.service"
        link.unlink(missing_ok=True)
        link.symlink_to(f"/etc/systemd/system/{name}.service")
    (root / RESULT.relative_to("/")).unlink(missing_ok=True)


def boot(root: Path, nspawn: str) -> None:
    """Boot the root until it switches itself off."""
    mounts = [f"--bind-ro={source}:{target}" for target, source in MOUNTED.items()]
    subprocess.run(
        [nspawn, "-D", str(root), "--register=no", "--keep-unit", "--boot", "--private-network", *mounts],
        check=False, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL,
    )  # fmt: skip


async def play_devices() -> None:
    """Play lidar and motor controller between two walls; note each motor command with its time."""
    import numpy as np

    from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet
    from wallride.sim.devices.scip import ScipEmulator
    from wallride.sim.devices.vesc import VescEmulator
    from wallride.sim.recordings.recording import to_sensor_mm
    from wallride.sim.virtual.devices import ranges_between_walls

    vesc, scip = VescEmulator(WIRE.with_name("vesc"), timeout_s=0.15), ScipEmulator()
    vesc.start()
    await scip.start_tcp(port=10940)
    scan_mm = to_sensor_mm(ranges_between_walls(1.0, 1.0), 0.02, 30.0)
    wheel_mps = way_m = 0.0
    start_s = next_s = time.monotonic()
    with WIRE.open("w", encoding="ascii", buffering=1) as wire:  # noqa: ASYNC230 - a file in memory
        while True:
            next_s += 0.025
            await asyncio.sleep(max(0.0, next_s - time.monotonic()))
            demand = vesc.demand(time.monotonic())
            wanted_mps = demand.value / GAIN if demand.kind == "speed" else 0.0
            wheel_mps += max(-0.15, min(0.15, wanted_mps - wheel_mps))
            way_m += wheel_mps * 0.025
            vesc.report(erpm=round(wheel_mps * GAIN), tachometer=round(way_m * GAIN / 10))
            flicker_mm = np.random.default_rng(scip.counts["published"]).integers(0, 5, scan_mm.size)
            scip.publish(scan_mm + flicker_mm, round((next_s - start_s) * 1000))
            wire.writelines(
                f"{at_s:.4f} {'brake' if payload[0] == Packet.SET_CURRENT_BRAKE else 'speed'}\n"
                for at_s, payload in vesc.wire
                if payload[0] in MOTOR_PACKETS
            )
            wire.write(f"{time.monotonic():.4f} {demand.kind}-demand\n")
            vesc.wire.clear()


def measure() -> dict[str, Any]:
    """Crash, hang and stop the service; return the times [s]."""
    until(lambda: shown("ActiveState") == "active", "ready")
    figures: dict[str, Any] = {
        "boot to ready": at("ActiveEnterTimestampMonotonic") - manager("UserspaceTimestampMonotonic"),
        "start to ready": at("ActiveEnterTimestampMonotonic") - at("ExecMainStartTimestampMonotonic"),
    }
    until_driving()
    figures["boot to driving"] = first_s(0.0, "speed-demand") - manager("UserspaceTimestampMonotonic")
    figures["scheduling"] = said("scheduling")
    for name, signal in (("crash (SIGSEGV)", "SEGV"), ("killed (SIGKILL)", "KILL"), ("hangs (SIGSTOP)", "STOP")):
        ready_s, struck_s = at("ActiveEnterTimestampMonotonic"), time.monotonic()
        systemctl("kill", "--kill-whom=main", f"--signal={signal}", "wallride")
        until(lambda: at("ActiveEnterTimestampMonotonic") > ready_s and shown("ActiveState") == "active", name)  # noqa: B023
        figures[f"{name} to ready"] = at("ActiveEnterTimestampMonotonic") - struck_s
        figures[f"{name} to the controller's own brake"] = first_s(struck_s, "brake-demand", "coast-demand") - struck_s
        until_driving()
    asked_s = time.monotonic()
    systemctl("stop", "wallride")
    figures["stop to brake"] = first_s(asked_s, "brake") - asked_s
    figures["stop to ended"] = time.monotonic() - asked_s
    figures["exit code of the stop"] = int(shown("ExecMainStatus"))
    figures["restarts"] = int(shown("NRestarts"))
    figures["security"] = run("systemd-analyze", "security", "--no-pager", "wallride.service").splitlines()[-1].strip()
    figures["verify"] = run("systemd-analyze", "verify", "/etc/systemd/system/wallride.service") or "silent"
    figures["status"] = run("/opt/wallride/bin/wallride", "service", "status").splitlines()
    return {name: round(value, 3) if isinstance(value, float) else value for name, value in figures.items()}


def until(holds: Callable[[], bool], what: str, within_s: float = 40.0) -> None:
    """Wait for something that must happen."""
    give_up_s = time.monotonic() + within_s
    while not holds():
        if time.monotonic() > give_up_s:
            raise SystemExit(f"{what}: not within {within_s} s\n{run('journalctl', '-u', 'wallride', '-n', '30')}")
        time.sleep(0.02)


def until_driving() -> None:
    """Wait for speeds on the wire, and for the wheels to turn."""
    since_s = time.monotonic()
    until(lambda: first_s(since_s, "speed-demand") < float("inf"), "driving")
    time.sleep(1.0)


def first_s(since_s: float, *kinds: str) -> float:
    """Return when the first of these was noted after a moment; infinity while none was."""
    for line in WIRE.read_text(encoding="ascii").splitlines():
        at_s, _, kind = line.partition(" ")
        if kind in kinds and float(at_s) > since_s:
            return float(at_s)
    return float("inf")


def shown(name: str) -> str:
    """Return a property of the service."""
    return run("systemctl", "show", "wallride", f"--property={name}", "--value").strip()


def at(name: str) -> float:
    """Return a time stamp of the service on the monotonic clock [s]."""
    return int(shown(name) or 0) / 1e6


def manager(name: str) -> float:
    """Return a time stamp of the service manager on the monotonic clock [s]."""
    return int(run("systemctl", "show", f"--property={name}", "--value").strip() or 0) / 1e6


def said(word: str) -> str:
    """Return the service's first log line with a word."""
    lines = run("journalctl", "-b", "-u", "wallride", "-o", "cat", "--no-pager").splitlines()
    return next((line for line in lines if word in line), "")


def systemctl(*arguments: str) -> None:
    """Tell the service manager something."""
    subprocess.run(["/bin/systemctl", *arguments], check=True)


def run(*command: str) -> str:
    """Return what a command prints on either output."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


if __name__ == "__main__":
    raise SystemExit(main())
