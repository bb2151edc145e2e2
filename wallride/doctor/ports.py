"""Serial ports before they are opened: there, named by udev, allowed, and held by no other program."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from wallride.doctor.computer import Computer, read
from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.drivers.address import SerialAddress, parse_address
from wallride.runtime.settings.devices import DEFAULT_DRIVERS, addresses
from wallride.runtime.settings.tree import Settings

RULES: Final = "/etc/udev/rules.d/99-wallride.rules"
RAW: Final = ("/dev/ttyACM", "/dev/ttyUSB")
PSEUDO: Final = "/dev/pts/"
"""Pseudo-terminals belong to an emulated device, whose process has both of its ends open."""
KNOWN: Final = {"lidar": ("15d1", None), "motor": ("0483", "5740")}
"""USB vendor and product of the devices for which the udev rules have names."""
NAMES: Final = {"lidar": "lidar", "motor": "vesc"}
BY_ID: Final = "use its name that stays: serial:///dev/serial/by-id/... (ls /dev/serial/by-id)"
PARENTS: Final = 4
"""Folders from a tty's device up to the USB device with its ids."""
STOP_SERVICE: Final = "sudo systemctl stop wallride"


def unusable_paths(settings: Settings) -> list[str]:
    """Return a sentence for each address that can never become a device: a directory, an ordinary file."""
    found = []
    for kind, text, path in serial_paths(settings):
        if path.is_dir():
            found.append(f"{kind} = {text}: is a directory; name the device in it")
        elif path.is_file():
            found.append(f"{kind} = {text}: is an ordinary file; name a serial device")
    return found


def serial_paths(settings: Settings) -> Iterator[tuple[str, str, Path]]:
    """Yield setting, address as written, and path of each device on a serial port."""
    for name, text in addresses(settings.lidar, settings.motor):
        try:
            address = parse_address(text)
        except ValueError:  # of an own driver, whose addresses are its own affair
            continue
        if isinstance(address, SerialAddress):
            yield name, text, Path(address.path)


def check_ports(computer: Computer, settings: Settings) -> list[Finding]:
    """Look at the serial ports and at the programs that are known to disturb them."""
    chosen = {"lidar": settings.lidar.driver, "motor": settings.motor.driver}
    found = [
        _port(computer, name, text, path, adapter=chosen[kind] != DEFAULT_DRIVERS[kind])
        for name, text, path in serial_paths(settings)
        for kind in [name.partition(".")[0]]
    ]
    places = [computer.device(str(path)).resolve() for _, _, path in serial_paths(settings)]
    if len(set(places)) < len(places):
        found.append(
            fail("ports", "lidar and motor have the same port", "name another port in lidar.address or motor.address")
        )
    return [*found, _brltty(computer), _modem_manager(computer)]


def running_car(computer: Computer, settings: Settings) -> int | None:
    """Return the process of the car that runs and has a port of these settings open; None without one."""
    for _, _, path in serial_paths(settings):
        for pid, _ in computer.holders(computer.device(str(path)).resolve()):
            words = [Path(word).name for word in computer.command(pid)]
            if ("wallride", "run") in pairwise(words):
                return pid
    return None


def _port(computer: Computer, name: str, text: str, path: Path, *, adapter: bool) -> Finding:
    """Look at one port. adapter: the device is behind a USB adapter, whose ids many devices have."""
    kind = name.partition(".")[0]
    subject, device = f"{kind} port", computer.device(str(path))
    what = f"{name} = {text}"
    if device.is_dir():
        return fail(subject, f"{what}: is a directory", "name the device in it")
    if device.is_file():
        return fail(subject, f"{what}: is an ordinary file", "name a serial device")
    if not device.exists() and adapter:
        return fail(subject, f"{what}: not there now", f"plug it in and power it; {BY_ID}")
    if not device.exists():
        return _missing(computer, kind, what)
    real = device.resolve()
    held = [] if str(real).startswith(PSEUDO) else computer.holders(real)
    if held:
        who = ", ".join(f"{name} (process {pid})" for pid, name in held)
        ours = any(name == "wallride" for _, name in held)
        return fail(
            subject, f"{what}: {who} holds it", f"end that program{f': {STOP_SERVICE}' if ours else ''}, then try again"
        )
    if not computer.may_use(device):
        return _forbidden(computer, subject, what)
    if str(path).startswith(RAW):
        return warn(
            subject, f"{what}: its number changes with the order of plugging in",
            BY_ID if adapter else f"use the name of the udev rules: serial:///dev/wallride-{NAMES[kind]}",
        )  # fmt: skip
    return ok(subject, what)


def _missing(computer: Computer, kind: str, what: str) -> Finding:
    subject = f"{kind} port"
    words = f"{what}: not there now"
    if (name := _plugged_in(computer, kind)) is not None:
        if computer.path(RULES).is_file():
            remedy = "sudo udevadm control --reload-rules && sudo udevadm trigger"
        else:
            remedy = "install the udev rules: sudo wallride service install"
        return fail(subject, f"{words}, but {name} is the device", f"{remedy}; or plug it in again")
    if _on_usb(computer, kind):
        return fail(
            subject, f"{words}, but the device is on the USB bus: its kernel module is missing",
            "sudo modprobe cdc_acm, and install the module or a newer system where there is none",
        )  # fmt: skip
    return fail(subject, words, "plug it in and power it, or install the udev rules: sudo wallride service install")


def _plugged_in(computer: Computer, kind: str) -> str | None:
    """Return the raw port of the device, whatever its name."""
    for port in sorted(computer.path("/sys/class/tty").glob("tty[AU][CS][MB]*")):
        place = (port / "device").resolve()
        for folder in (place, *place.parents[:PARENTS]):
            vendor, product = read(folder / "idVendor"), read(folder / "idProduct")
            if vendor:
                if _is(kind, vendor, product):
                    return f"/dev/{port.name}"
                break
    return None


def _on_usb(computer: Computer, kind: str) -> bool:
    return any(
        _is(kind, read(folder / "idVendor"), read(folder / "idProduct"))
        for folder in computer.path("/sys/bus/usb/devices").glob("*")
    )


def _is(kind: str, vendor: str, product: str) -> bool:
    wanted_vendor, wanted_product = KNOWN[kind]
    return vendor == wanted_vendor and wanted_product in {None, product}


def _forbidden(computer: Computer, subject: str, what: str) -> Finding:
    if "dialout" not in computer.groups:
        remedy = f"sudo usermod -aG dialout {computer.user}, then log out and in again"
    else:
        remedy = "give it the group dialout: sudo wallride service install, then plug it in again"
    return fail(subject, f"{what}: {computer.user} may not open it", remedy)


def _brltty(computer: Computer) -> Finding:
    rules = [place for top in ("/lib", "/usr/lib") for place in computer.path(f"{top}/udev/rules.d").glob("*brltty*")]
    if rules or any(name == "brltty" for _, name in computer.processes()):
        return warn(
            "brltty", "it is installed, and takes USB serial adapters (CP210x, CH340) away", "sudo apt remove brltty"
        )
    return ok("brltty", "not installed")


def _modem_manager(computer: Computer) -> Finding:
    if not any(name == "ModemManager" for _, name in computer.processes()):
        return ok("ModemManager", "does not run")
    if "ID_MM_DEVICE_IGNORE" in computer.text(RULES):
        return ok("ModemManager", "runs, and is kept away by the udev rules")
    return warn(
        "ModemManager", "it runs, and sends modem commands to every new serial port",
        "keep it away with the udev rules: sudo wallride service install; or sudo apt remove modemmanager",
    )  # fmt: skip
