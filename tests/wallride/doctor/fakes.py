"""A healthy computer in a folder, and ways to make it ill."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from wallride.doctor.computer import Computer
from wallride.runtime.settings.tree import load_settings

NOW = datetime(2026, 12, 1, 12, tzinfo=UTC).timestamp()
ROOT = Path(__file__).parents[3]

ROUTES = """Iface Destination Gateway Flags RefCnt Use Metric Mask MTU Window IRTT
wlan0 00000000 0101A8C0 0003 0 0 600 00000000 0 0 0
wlan0 0001A8C0 00000000 0001 0 0 600 00FFFFFF 0 0 0
eth0 0000A8C0 00000000 0001 0 0 100 00FFFFFF 0 0 0
"""
TRIE = """Main:
  +-- 0.0.0.0/0 3 0 5
     |-- 192.168.0.0
        /24 link UNICAST
     |-- 192.168.0.15
        /32 host LOCAL
"""
PAD = """I: Bus=0003 Vendor=046d Product=c21f Version=0305
N: Name="Logitech Gamepad F710"
H: Handlers=event5 js0

I: Bus=0003 Vendor=413c Product=2113 Version=0111
N: Name="Dell Keyboard"
H: Handlers=sysrq kbd event1
"""


def put(root, name, text=""):
    """Write a file of the fake file system."""
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.write_text(text)
    return path


def link(root, name, target):
    """Make a link of the fake file system."""
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.symlink_to(target)


def healthy(root: Path) -> Computer:
    """Return a computer with a car on it: all devices there, service installed, nothing in the way."""
    for name in ("99-wallride.rules", "wallride.service"):
        where = "etc/udev/rules.d" if name.endswith("rules") else "etc/systemd/system"
        put(root, f"{where}/{name}", (ROOT / "systemd" / name).read_text())
    link(root, "etc/systemd/system/multi-user.target.wants/wallride.service", "/etc/systemd/system/wallride.service")
    link(root, "dev/wallride-vesc", "/dev/null")
    link(root, "dev/wallride-lidar", "/dev/zero")
    put(root, "dev/input/event5")
    put(root, "proc/net/route", ROUTES)
    put(root, "proc/net/fib_trie", TRIE)
    put(root, "proc/bus/input/devices", PAD)
    put(root, "proc/100/comm", "wallride\n")
    put(root, "sys/class/net/eth0/carrier", "1\n")
    put(root, "sys/class/net/wlan0/wireless/x")
    put(root, "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "schedutil\n")
    put(root, "sys/class/thermal/thermal_zone0/temp", "45000\n")
    put(root, "sys/class/thermal/thermal_zone0/type", "CPU-therm\n")
    return Computer(
        root=root,
        devices=root,
        user="ann",
        groups=frozenset({"ann", "dialout", "input"}),
        now_unix_s=NOW,
        may_use=lambda _path: True,
        free_bytes=lambda _path: 50_000_000_000,
        realtime_refusal=lambda: "",
        port_is_free=lambda _host, _port: True,
        has_module=lambda _name: True,
    )


def usb(root, port, vendor, product):
    """Plug a USB serial device in under its raw name."""
    put(root, "sys/devices/usb1/1-2/idVendor", vendor)
    put(root, "sys/devices/usb1/1-2/idProduct", product)
    (root / "sys/devices/usb1/1-2/1-2:1.0").mkdir(parents=True, exist_ok=True)
    link(root, f"sys/class/tty/{port}/device", root / "sys/devices/usb1/1-2/1-2:1.0")


def settings(*assignments):
    """Return the car's settings with changes."""
    return load_settings(None, assignments)


def changed(computer, **fields):
    """Return the computer with other rights or answers."""
    return replace(computer, **fields)
