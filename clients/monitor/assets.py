"""Files of the page, read once from the package: no path that a browser sends ever reaches the disk."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable

INDEX = "index.html"
TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".webmanifest": "application/manifest+json",
}


@dataclass(frozen=True, slots=True)
class Asset:
    """One file: its media type and its bytes."""

    content_type: str
    body: bytes


def read_all() -> dict[str, Asset]:
    """Return every file of the page by its path, such as `controls/hands.js`."""
    return dict(_files_in(resources.files("wallride.clients.monitor").joinpath("page"), ""))


def _files_in(folder: Traversable, path: str) -> Iterator[tuple[str, Asset]]:
    for file in folder.iterdir():
        content_type = TYPES.get("." + file.name.rpartition(".")[2])
        if file.is_dir():
            yield from _files_in(file, f"{path}{file.name}/")
        elif content_type is not None:
            yield path + file.name, Asset(content_type, file.read_bytes())
