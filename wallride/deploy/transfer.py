"""What is copied to the car: wheels by their checksums, so that none is sent twice; then the folder of a deployment."""

import hashlib
import io
import tarfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from wallride.deploy.ssh import SshConnection

WHEELS = "wheelhouse/"


@dataclass(frozen=True, slots=True)
class Shipment:
    """The files of one deployment. own: sent every time, by their place in its folder on the car; wheels: of others."""

    own: Mapping[str, Path]
    wheels: Sequence[Path] = ()

    def manifest(self) -> str:
        """Return a list for `sha256sum --check`: checksum and place of every file."""
        every = {**self.own, **{f"{WHEELS}{path.name}": path for path in self.wheels}}
        return "".join(f"{checksum(path)}  {name}\n" for name, path in sorted(every.items()))


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def absent_wheels(car: SshConnection, wheels: Sequence[Path]) -> list[Path]:
    """Return the wheels that the car does not have already, in full, from a deployment before."""
    listing = "".join(f"{checksum(path)} {path.name}\n" for path in wheels)
    absent = set(car.ask("absent", text=listing).split())
    return [path for path in wheels if path.name in absent]


def send(car: SshConnection, identity: str, shipment: Shipment, absent: Sequence[Path]) -> None:
    """Copy a shipment, of its wheels those that are absent; DeployError where the car has not all of it in the end."""

    def write(pipe: IO[bytes]) -> None:
        with tarfile.open(fileobj=pipe, mode="w|") as archive:
            listing = shipment.manifest().encode()
            entry = tarfile.TarInfo("manifest")
            entry.size = len(listing)
            archive.addfile(entry, io.BytesIO(listing))
            for path in absent:
                archive.add(path, f"common/{path.name}", filter=_nameless)
            for name, path in shipment.own.items():
                archive.add(path, name, filter=_nameless)

    car.feed("receive", identity, write=write)


def _nameless(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """Leave out who owns the file here."""
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = ""
    return entry
