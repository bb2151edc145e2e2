"""A VESC's application configuration as a file: written before every change, and what `wallride vesc restore` takes."""

import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from wallride.drivers.vesc.replies import Firmware


class BackupError(Exception):
    """The file is of no use; the text is one line with the remedy."""


@dataclass(frozen=True, slots=True)
class Backup:
    """uuid: of the controller, in hexadecimal digits. configuration: from its signature on."""

    firmware: str
    hardware: str
    uuid: str
    configuration: bytes

    @classmethod
    def of(cls, firmware: Firmware, configuration: bytes) -> "Backup":
        """Return the backup of a controller."""
        return cls(firmware.version, firmware.hardware, firmware.uuid.hex(), configuration)


def backup_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of backups: in the user's folder of states."""
    return Path(environment.get("XDG_STATE_HOME") or "~/.local/state").expanduser() / "wallride" / "vesc"


def save(backup: Backup, folder: Path) -> Path:
    """Write a backup to the disk, under a name of its own; OSError where it cannot be."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = f"{backup.uuid[-8:] or 'vesc'}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}"
    text = {
        "firmware": backup.firmware, "hardware": backup.hardware, "uuid": backup.uuid,
        "configuration": backup.configuration.hex(),
    }  # fmt: skip
    for number in range(1, 1000):
        path = folder / f"{stem}{'' if number == 1 else f'-{number}'}.json"
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(json.dumps(text, indent=1) + "\n")
                file.flush()
                os.fsync(file.fileno())  # before the controller is changed
        except FileExistsError:
            continue
        return path
    raise FileExistsError(17, "too many backups of one second", str(folder))


def load(path: Path) -> Backup:
    """Read a backup; BackupError for another file."""
    try:
        text = json.loads(path.read_text(encoding="utf-8"))
        found = Backup(text["firmware"], text["hardware"], text["uuid"], bytes.fromhex(text["configuration"]))
    except OSError as error:
        raise BackupError(f"{path}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise BackupError(f"{path}: is no copy of `wallride vesc set`; they are in {backup_folder()}") from None
    return found
