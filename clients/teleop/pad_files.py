"""Files for unknown pads: one TOML per pad in the user's own configuration folder."""

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path

from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pads import Binding, Layout, LayoutError, layout
from wallride.runtime.host.output_files import write_file


def folder() -> Path:
    r"""Return where pads are kept: ~/.config/wallride/pads, ~/Library/Application Support/..., %APPDATA%\..."""
    import platformdirs  # not on every car, which reads its pads from /etc

    return platformdirs.user_config_path("wallride", appauthor=False, roaming=True) / "pads"


def to_toml(guid: str, name: str, bindings: Mapping[Control, Binding]) -> str:
    """Return the text of a pad's file."""
    lines = ["# Written by `wallride teleop --map`. Speed is positive forward, steering positive to the left."]
    lines += [f"guid = {json.dumps(guid)}", f"name = {json.dumps(name)}", "", "[controls]"]
    lines += [f'{control.value} = "{bindings[control]}"' for control in Control]
    return "\n".join(lines) + "\n"


def read(text: str, origin: str) -> tuple[str, Layout]:
    """Return a pad's GUID (or USB id) and layout; LayoutError names the fault."""
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise LayoutError(f"{origin}: {error}") from None
    guid, name, controls = values.get("guid"), values.get("name", "pad"), values.get("controls")
    if not isinstance(guid, str) or not isinstance(name, str) or not isinstance(controls, dict):
        raise LayoutError(f"{origin}: needs guid, name and [controls]; write it with wallride teleop --map")
    if not all(isinstance(place, str) for place in controls.values()):
        raise LayoutError(f'{origin}: a control is a text, like speed = "a1~"')
    try:
        return guid.lower(), layout(name, controls, origin)
    except LayoutError as error:
        raise LayoutError(f"{origin}: {error}") from None


def read_all(where: Path) -> tuple[dict[str, Layout], list[str]]:
    """Return the layouts of a folder by GUID, and a sentence for every file that cannot be used."""
    layouts: dict[str, Layout] = {}
    problems: list[str] = []
    for path in sorted(where.glob("*.toml")):
        try:
            guid, found = read(path.read_text(encoding="utf-8"), path.name)
            layouts[guid] = found
        except LayoutError as error:
            problems.append(str(error))
        except (OSError, UnicodeDecodeError) as error:
            problems.append(f"{path.name}: cannot be read ({error})")
    return layouts, problems


def save(where: Path, guid: str, text: str) -> Path:
    """Write a pad's file, whole or not at all; returns its path."""
    where.mkdir(parents=True, exist_ok=True)
    path = where / f"{guid}.toml"
    write_file(path, text)
    return path
