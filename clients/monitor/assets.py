"""Files of the page, read once from the package: no path that a browser sends ever reaches the disk."""

from dataclasses import dataclass
from importlib import resources

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
    """Return every file of the page by name."""
    folder = resources.files("clients.monitor").joinpath("page")
    found = {}
    for file in folder.iterdir():
        content_type = TYPES.get("." + file.name.rpartition(".")[2])
        if content_type is not None:
            found[file.name] = Asset(content_type, file.read_bytes())
    return found
